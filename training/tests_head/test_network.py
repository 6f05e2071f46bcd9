import pytest
import torch

from attributes import activate, lifted
from export import example
from gaussians import Y0
from network import CHANNELS, Head, load, save

ACTIVATIONS = ("softplus", "sigmoid", "relu")


@pytest.mark.parametrize("encoder", ["tiny", "resnet18", "resnet50"])
def test_any_size_is_padded_and_cropped(encoder):
    head = Head(encoder).eval()
    inputs = example((2, 33, 47), 1)
    with torch.no_grad():
        assert head.predict(*inputs).shape == (2, CHANNELS, 33, 47)


def test_padding_follows_the_contract():
    head = Head("tiny").eval()
    torch.nn.init.normal_(head.last.weight, std=0.1)
    images, depth, intrinsics = example((1, 30, 40), 1)
    padded_images, padded_depth = torch.zeros(1, 3, 32, 64), torch.zeros(1, 32, 64)
    padded_images[:, :, :30, :40], padded_depth[:, :30, :40] = images, depth
    with torch.no_grad():
        expected = head(padded_images, padded_depth, intrinsics)[:, :, :30, :40]
        assert torch.equal(head.predict(images, depth, intrinsics), expected)


def test_every_view_is_processed_independently():
    head = Head("tiny").eval()
    torch.nn.init.normal_(head.last.weight, std=0.1)
    inputs = example((3, 32, 64), 1)
    with torch.no_grad():
        together = head(*inputs)
        alone = torch.cat([head(*(t[i : i + 1] for t in inputs)) for i in range(3)])
    # Convolutions with another batch size sum in another order.
    torch.testing.assert_close(together, alone, rtol=0, atol=1e-5)


@pytest.mark.parametrize("activation", ACTIVATIONS)
@pytest.mark.parametrize("mode", ["train", "eval"])
def test_an_untrained_head_is_the_surfel_solution(activation, mode):
    head = getattr(Head("tiny", activation), mode)()
    images, depth, intrinsics = example((2, 30, 40), 1)
    with torch.no_grad():
        raw = head.predict(images, depth, intrinsics)
    pose = torch.eye(4)
    for i in range(2):
        points = lifted(depth[i], intrinsics[i], pose).reshape(-1, 3)
        rgb = images[i].reshape(3, -1).T
        g = activate(raw[i].reshape(CHANNELS, -1).T, points, pose[:3, :3].expand(len(rgb), 3, 3), rgb, activation)
        assert torch.equal(g.means, points)
        assert torch.equal(g.rotations, torch.tensor([1.0, 0, 0, 0]).expand(len(rgb), 4))
        torch.testing.assert_close(g.opacities, torch.full((len(rgb),), 0.9525741), rtol=0, atol=1e-6)
        z = depth[i].reshape(-1, 1)
        footprint = torch.where(z > 0, 0.5 * z / (1.1 * 40), torch.tensor(0.01))
        # Logarithm and exponential of a number near -5 in float32.
        torch.testing.assert_close(g.scales, footprint.expand(-1, 3), rtol=2e-6, atol=0)
        torch.testing.assert_close(0.5 + Y0 * g.sh[:, 0], rgb, rtol=0, atol=1e-6)
        assert torch.equal(g.sh[:, 1:], torch.zeros_like(g.sh[:, 1:]))


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_the_scale_starts_finite_at_any_depth_and_focal_length(activation):
    head = Head("tiny", activation).eval()
    images = torch.rand(1, 3, 32, 32)
    depth = torch.logspace(-38, 9, 32).expand(1, 32, 32).contiguous()
    for focal in (1.0, 1e6):
        intrinsics = torch.tensor([[[focal, 0, 16], [0, focal, 16], [0, 0, 1]]])
        with torch.no_grad():
            assert head(images, depth, intrinsics).isfinite().all()


def test_views_without_depth_are_processed():
    images, depth, intrinsics = example((1, 32, 32), 1)
    with torch.no_grad():
        assert Head("tiny").eval()(images, torch.zeros_like(depth), intrinsics).isfinite().all()


def test_a_checkpoint_gives_the_same_head_back(tmp_path):
    head = Head("tiny", "sigmoid", offset=False)
    torch.nn.init.normal_(head.last.weight, std=0.1)
    inputs = example((2, 32, 64), 1)
    head(*inputs)  # moves the running statistics
    head.eval()
    save(head, tmp_path / "head.pt", iteration=7)
    again = load(tmp_path / "head.pt")
    assert (again.encoder_name, again.scale_activation, again.offset) == ("tiny", "sigmoid", False)
    with torch.no_grad():
        assert torch.equal(head(*inputs), again(*inputs))


IMAGENET_LAYOUTS = {
    # Names of the parameters and buffers in torchvision's files, without the classifier.
    "resnet18": (120, {"layer4.1.conv2.weight": (512, 512, 3, 3), "layer2.0.downsample.0.weight": (128, 64, 1, 1)}),
    "resnet50": (318, {"layer4.2.conv3.weight": (2048, 512, 1, 1), "layer1.0.downsample.1.bias": (256,)}),
}


@pytest.mark.parametrize("encoder", IMAGENET_LAYOUTS)
def test_weights_in_the_imagenet_layout_load(encoder):
    head = Head(encoder)
    own = head.encoder.state_dict()
    count, shapes = IMAGENET_LAYOUTS[encoder]
    assert len(own) == count
    assert {name: tuple(own[name].shape) for name in shapes} == shapes
    state = {k: torch.rand_like(v) if v.is_floating_point() else v for k, v in own.items()}
    state["conv1.weight"] = torch.rand(64, 3, 7, 7)
    state |= {"fc.weight": torch.rand(1000, own["bn1.weight"].numel()), "fc.bias": torch.rand(1000)}
    head.encoder.load_imagenet(state)
    assert torch.equal(head.encoder.conv1.weight[:, :3], state["conv1.weight"])
    assert not head.encoder.conv1.weight[:, 3].any()
    assert torch.equal(head.encoder.layer3[0].bn2.running_var, state["layer3.0.bn2.running_var"])


def test_weights_of_another_network_are_refused():
    with pytest.raises(ValueError, match="conv1.weight"):
        Head("resnet18").encoder.load_imagenet({"conv1.weight": torch.rand(64, 4, 7, 7)})
    with pytest.raises(RuntimeError, match="layer4"):
        Head("resnet18").encoder.load_imagenet({"conv1.weight": torch.rand(64, 3, 7, 7)})


def test_unknown_activations_are_refused():
    with pytest.raises(ValueError, match="softplus"):
        Head("tiny", "exp")
