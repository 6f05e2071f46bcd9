"""Public depth networks as ONNX files that the library can use for its ``onnx`` prior.

Each module is a program: ``python -m vehicle_gaussians.export.mapanything --help``.

``mapanything``, ``depth_anything_3``: geometry from images, intrinsics and poses. ``tiny``: a small network of random
weights with the same face, for tests. ``lpips``: the perceptual distance. ``contract``: checks a finished file.

The programs need torch, onnx, onnxscript and onnxruntime; the library itself needs none of them.
"""
