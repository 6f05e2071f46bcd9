// Steps of OpenSplat's CPU renderer, for opensplat.py: built with the sources of a clone, none of which is here.
//
// The calls, their order and their arguments are those of OpenSplat's own training step on the CPU, from its
// Model::forward to its optimisers, without the part for densification (gradients of splat centres).

#include <torch/extension.h>

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include <project_gaussians.hpp>
#include <rasterize_gaussians.hpp>
#include <spherical_harmonics.hpp>
#include <ssim.hpp>

namespace {

using torch::Tensor;
using torch::indexing::None;
using torch::indexing::Slice;

constexpr float SSIM_WEIGHT = 0.2f;

// Whether the derivative of colour with respect to the centre, through the view direction, is included. OpenSplat omits
// it.
enum class Turn { Left, Taken };

// OpenSplat's projection: the principal point is the middle of the picture.
Tensor projection(float fx, float fy, int width, int height) {
    constexpr float NEAR = 0.001f, FAR = 1000.0f;
    return torch::tensor({
        {2.0f * fx / width, 0.0f, 0.0f, 0.0f},
        {0.0f, 2.0f * fy / height, 0.0f, 0.0f},
        {0.0f, 0.0f, (FAR + NEAR) / (FAR - NEAR), -FAR * NEAR / (FAR - NEAR)},
        {0.0f, 0.0f, 1.0f, 0.0f},
    });
}

class Peer {
public:
    // Parameters in OpenSplat's form: means, ln scales [n][3], quaternions [n][4], logits [n][1], colour [n][3] and
    // [n][k][3]. Views: camera_from_world [v][4][4], fx fy cx cy [v][4], targets [v][h][w][3]. Rates: one per
    // parameter.
    Peer(std::vector<Tensor> parameters, int degree, Tensor cameras, Tensor intrinsics, Tensor targets,
         std::vector<double> rates, double noise)
        : start(std::move(parameters)), degree(degree), cameras(cameras), intrinsics(intrinsics), targets(targets),
          rates(std::move(rates)), noise(noise) {
        reset();
    }

    // Restores the initial Gaussians and resets the optimisers.
    void reset() {
        now.clear();
        own.clear();
        first.clear();
        second.clear();
        steps.clear();
        for (size_t k = 0; k < start.size(); k++) {
            now.push_back(start[k].clone().requires_grad_());
            auto options = torch::optim::AdamOptions(rates[k]).eps(noise);
            own.push_back(std::make_unique<torch::optim::Adam>(std::vector<Tensor>{now[k]}, options));
            first.push_back(torch::zeros_like(start[k]));
            second.push_back(torch::zeros_like(start[k]));
            steps.push_back(torch::zeros({}));
        }
    }

    // Draws a picture, and computes its loss and the gradient of every parameter.
    void gradients(int view) {
        descend(view);
        clear();
    }

    // Picture, loss, gradients, and a step of OpenSplat's optimisers.
    void step(int view) {
        descend(view);
        for (auto &adam : own) adam->step();
        clear();
    }

    // Picture, loss, gradients, and a step of libtorch's fastest optimiser.
    void fused_step(int view) {
        descend(view);
        torch::NoGradGuard none;
        for (size_t k = 0; k < now.size(); k++) {
            steps[k] += 1;
            at::_fused_adam_({now[k]}, {now[k].grad()}, {first[k]}, {second[k]}, {}, {steps[k]}, rates[k], 0.9, 0.999, 0.0,
                             noise, false, false);
        }
        clear();
    }

    // The picture, the loss, and its gradient with respect to the means.
    std::vector<Tensor> look(int view, bool turning) {
        Tensor rgb = picture(view, turning ? Turn::Taken : Turn::Left);
        Tensor loss = of(rgb, view);
        loss.backward();
        std::vector<Tensor> seen{rgb.detach().clone(), loss.detach().clone(), now[0].grad().clone()};
        clear();
        return seen;
    }

private:
    std::vector<Tensor> start, now;
    int degree;
    Tensor cameras, intrinsics, targets;
    std::vector<double> rates;
    double noise;
    std::vector<std::unique_ptr<torch::optim::Adam>> own;
    std::vector<Tensor> first, second, steps;

    void descend(int view) {
        of(picture(view, Turn::Left), view).backward();
    }

    void clear() {
        for (Tensor &parameter : now) parameter.mutable_grad().reset();
    }

    Tensor of(const Tensor &rgb, int view) {
        return fusedL1SsimLoss(rgb, targets[view], torch::empty({0}, rgb.options()), SSIM_WEIGHT, true);
    }

    Tensor picture(int view, Turn turn) {
        const Tensor &means = now[0], &scales = now[1], &quats = now[2], &logits = now[3];
        const int height = targets.size(1), width = targets.size(2);
        const float *k = intrinsics.data_ptr<float>() + 4 * view;
        const float fx = k[0], fy = k[1], cx = k[2], cy = k[3];
        Tensor camera = cameras[view];
        Tensor rotation = camera.index({Slice(None, 3), Slice(None, 3)});
        Tensor center = -torch::matmul(rotation.transpose(0, 1), camera.index({Slice(None, 3), Slice(3, 4)}));
        Tensor colors = torch::cat({now[4].index({Slice(), None, Slice()}), now[5]}, 1);

        auto p = ProjectGaussiansCPU::apply(means, torch::exp(scales), 1, quats / quats.norm(2, {-1}, true), camera,
                                            torch::matmul(projection(fx, fy, width, height), camera), fx, fy, cx, cy,
                                            height, width);
        const Tensor &xys = p[0], &radii = p[1], &conics = p[2], &cov2d = p[3], &depths = p[4];

        Tensor directions = (turn == Turn::Taken ? means : means.detach()) - center.transpose(0, 1);
        directions = directions / directions.norm(2, {-1}, true);
        Tensor rgbs = SphericalHarmonicsCPU::apply(degree, directions, colors);
        rgbs = torch::clamp_min(rgbs + 0.5f, 0.0f);

        Tensor none = torch::empty({0});
        auto drawn = RasterizeGaussiansCPU::apply(xys, radii, conics, rgbs, torch::sigmoid(logits), cov2d, depths, height,
                                                  width, torch::zeros({3}), none, none, none, none);
        return torch::clamp_max(drawn[0], 1.0f);
    }
};

}  // namespace

PYBIND11_MODULE(TORCH_EXTENSION_NAME, module) {
    // Autograd does not run while the GIL is held.
    using Release = pybind11::call_guard<pybind11::gil_scoped_release>;
    pybind11::class_<Peer>(module, "Peer")
        .def(pybind11::init<std::vector<Tensor>, int, Tensor, Tensor, Tensor, std::vector<double>, double>())
        .def("reset", &Peer::reset, Release())
        .def("gradients", &Peer::gradients, Release())
        .def("step", &Peer::step, Release())
        .def("fused_step", &Peer::fused_step, Release())
        .def("look", &Peer::look, Release());
}
