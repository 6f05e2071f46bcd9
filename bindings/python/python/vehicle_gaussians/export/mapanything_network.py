"""The public MapAnything class as a `graph.Network`, from its images, intrinsics and poses to its raw channels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from mapanything.models import MapAnything
from torch import Tensor, nn
from uniception.models.encoders import EncoderGlobalRepInput, ViTEncoderInput, ViTEncoderNonImageInput
from uniception.models.prediction_heads.base import (
    PredictionHeadInput,
    PredictionHeadLayeredInput,
    PredictionHeadTokenInput,
)

from .graph import Given, fix_position_embedding, refuse_missing_tensors
from .script import Unavailable, config_of, need

#: Representation that the wrapper's activations assume: ray, depth along it, pose, confidence and mask.
REPRESENTATION = "raydirs+depth+pose+confidence+mask"


class MapAnythingNetwork(nn.Module):
    """Calls the parts of one model; those for depth inputs stay unused, and so out of the graph."""

    def __init__(self, model: Any, size: tuple[int, int]) -> None:
        super().__init__()
        if model.scene_rep_type != REPRESENTATION:
            raise Unavailable(f"these weights answer {model.scene_rep_type}; allowed: {REPRESENTATION}")
        sharing = model.info_sharing
        if sharing.custom_positional_encoding is not None or sharing.use_pe_for_non_reference_views:
            raise Unavailable("these weights encode the number of each view, which this wrapper does not")
        width, height = size
        self.patch = model.encoder.patch_size
        fix_position_embedding(model.encoder.model, height, width, self.patch)
        self.model = model
        self.blocks = sharing.self_attention_blocks
        depth = len(self.blocks)
        self.taps = [index % depth for index in sharing.indices]
        self.fused_level = bool(model.use_encoder_features_for_dpt)
        self.scale_token = model.scale_token
        told_apart = sharing.distinguish_ref_and_non_ref_views
        self.reference = sharing.view_pos_table[0].clone() if told_apart else None
        self.norm, self.project = sharing.norm, sharing.proj_embed

    def encode_images(self, images: Tensor) -> tuple[Tensor, Tensor | None]:
        encoder = self.model.encoder
        answer = encoder(ViTEncoderInput(image=images, data_norm_type=encoder.data_norm_type))
        extra = answer.registers if self.model.use_register_tokens_from_encoder else None
        return tokens_from_map(answer.features), None if extra is None else extra.transpose(1, 2)

    def encode_rays(self, rays: Tensor) -> Tensor:
        return tokens_from_map(self.model.ray_dirs_encoder(ViTEncoderNonImageInput(data=rays)).features)

    def encode_rotation(self, rotation: Tensor) -> Tensor:
        return self.model.cam_rot_encoder(EncoderGlobalRepInput(data=rotation)).features

    def encode_translation(self, translation: Tensor) -> Tensor:
        return self.model.cam_trans_encoder(EncoderGlobalRepInput(data=translation)).features

    def encode_distance(self, log_distance: Tensor) -> Tensor:
        return self.model.cam_trans_scale_encoder(EncoderGlobalRepInput(data=log_distance)).features

    def fuse(self, tokens: Tensor) -> Tensor:
        return self.model.fusion_norm_layer(tokens)

    def norm_tap(self, tokens: Tensor) -> Tensor:
        return self.norm(tokens) if self.model.info_sharing.norm_intermediate else tokens

    def dense(self, levels: list[Tensor], given: Given) -> Tensor:
        size = tuple(int(side) for side in given.rays.shape[-2:])
        return self.model.dense_head(
            PredictionHeadLayeredInput(list_features=levels, target_output_shape=size)
        ).decoded_channels

    def pose(self, last: Tensor, given: Given) -> Tensor:
        return self.model.pose_head(PredictionHeadInput(last_feature=last)).decoded_channels

    def scale(self, token: Tensor, given: Given) -> Tensor:
        answer = self.model.scale_head(PredictionHeadTokenInput(last_feature=token[:, :, None]))
        return answer.decoded_channels.view(1)


def tokens_from_map(features: Tensor) -> Tensor:
    """(N,T,C) from (N,C,H/patch,W/patch)."""
    return features.flatten(2).transpose(1, 2)


def load(folder: Path) -> Any:
    """The model with the weights of a folder."""
    config = config_of(folder)
    encoder = dict(config.get("encoder_config", {}))
    if encoder.get("uses_torch_hub"):
        # Only the code of torch.hub is needed: the weights are in the folder.
        encoder["torch_hub_pretrained"] = False
    model = built(lambda: MapAnything.from_pretrained(str(folder), encoder_config=encoder))
    file = folder / "model.safetensors"
    with need("safetensors", "pip install safetensors").safe_open(str(file), framework="pt") as opened:
        # Upstream loads all weights whose names match.
        refuse_missing_tensors(model, set(opened.keys()), file)
    return model


def random(kind: str) -> Any:
    """Random initial weights: the published architecture ("giant"), or one of a thirtieth of its size ("small")."""
    return built(lambda: MapAnything(**architecture(kind)))


def built(build: Any) -> Any:
    try:
        return build()
    except (OSError, RuntimeError) as error:
        first = str(error).strip().split("\n")[0]
        raise Unavailable(
            f"MapAnything cannot be built ({first}): it takes the code of DINOv2 from "
            "github.com/facebookresearch/dinov2 through torch.hub, once, where the network is"
        ) from error


def architecture(kind: str) -> dict[str, Any]:
    """Arguments of the class: version 1.1 as published, or small."""
    size, kept, depth, channels, heads, taps = {
        "giant": ("giant", 24, 16, 1536, 24, [7, 11]),
        "small": ("small", 2, 4, 384, 6, [1, 2]),
    }[kind]
    no_limit = {"vmin": -float("inf"), "vmax": float("inf")}

    def limits(prefix: str) -> dict[str, float]:
        return {f"{prefix}_{side}": value for side, value in no_limit.items()}

    def given(name: str, numbers: int, encoder: str = "global_rep_encoder") -> dict[str, Any]:
        return {"name": name, "in_chans": numbers, "encoder_str": encoder}

    dense = {"apply_pe": False}
    return {
        "name": f"random_{kind}",
        "encoder_config": {
            "encoder_str": "dinov2",
            "name": f"dinov2_{size}",
            "data_norm_type": "dinov2",
            "size": size,
            "with_registers": False,
            "uses_torch_hub": True,
            "torch_hub_pretrained": False,
            "gradient_checkpointing": False,
            "norm_returned_features": False,
            "keep_first_n_layers": kept,
        },
        "info_sharing_config": {
            "model_type": "alternating_attention",
            "model_return_type": "intermediate_features",
            "custom_positional_encoding": None,
            "module_args": {
                "name": "alternating",
                "indices": taps,
                "norm_intermediate": True,
                "depth": depth,
                "dim": channels,
                "num_heads": heads,
                "mlp_ratio": 4,
                "qkv_bias": True,
                "qk_norm": False,
                "init_values": 1e-5,
                "distinguish_ref_and_non_ref_views": True,
                "gradient_checkpointing": False,
            },
        },
        "pred_head_config": {
            "type": "dpt+pose",
            "gradient_checkpointing": False,
            "feature_head": {"feature_dim": 256, "hooks": [0, 1, 2, 3], "checkpoint_gradient": False},
            "regressor_head": {"output_dim": 6, "checkpoint_gradient": False},
            "pose_head": {"num_resconv_block": 2, "rot_representation_dim": 4},
            "scale_head": {"output_dim": 1},
            "adaptor_type": REPRESENTATION,
            "dpt_adaptor": {
                "name": "dense",
                "ray_directions_mode": "linear",
                "ray_directions_normalize_to_unit_sphere": True,
                "ray_directions_normalize_to_unit_image_plane": False,
                "ray_directions_clamp_min_of_z_dir": False,
                "ray_directions_z_dir_min": -float("inf"),
                **limits("ray_directions"),
                "depth_mode": "exp",
                "depth_vmin": 0,
                "depth_vmax": float("inf"),
                "confidence_type": "exp",
                "confidence_vmin": 1,
                "confidence_vmax": float("inf"),
            },
            "pose_adaptor": {
                "name": "pose",
                "cam_trans_mode": "linear",
                **limits("cam_trans"),
                "quaternions_mode": "linear",
                "quaternions_normalize": True,
                **limits("quaternions"),
            },
            "scale_adaptor": {"name": "scale", "mode": "exp", "vmin": 1e-8, "vmax": float("inf")},
        },
        "geometric_input_config": {
            "ray_dirs_encoder_config": given("rays", 3, "dense_rep_encoder") | dense,
            "depth_encoder_config": given("depth", 1, "dense_rep_encoder") | dense,
            "cam_rot_encoder_config": given("rotation", 4),
            "cam_trans_encoder_config": given("translation", 3),
            "scale_encoder_config": given("distance", 1),
        },
        "use_register_tokens_from_encoder": True,
        "info_sharing_mlp_layer_str": "swiglufused",
    }


def precise() -> None:
    """Upstream allows TF32 products on import; an export on a GPU machine is compared in float32."""
    torch.backends.cuda.matmul.allow_tf32 = False
