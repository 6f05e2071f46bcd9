// Code shared by the tests of vg.hpp.
#ifndef VG_TEST_HPP
#define VG_TEST_HPP

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "vg.hpp"

#define CHECK(...)                                                                                           \
    do {                                                                                                     \
        if (!(__VA_ARGS__)) {                                                                                \
            std::fprintf(stderr, "%s:%d: not true: %s\n", __FILE__, __LINE__, #__VA_ARGS__);                 \
            std::exit(1);                                                                                    \
        }                                                                                                    \
    } while (0)

/// Whether a call failed with this status and message.
template <class T> bool failed(const vg::Result<T> &result, vg_status status, const char *words) {
    if (result || result.error().status != status ||
        result.error().message.find(words) == std::string::npos) {
        std::fprintf(stderr, "%s\n", result ? "(succeeded)" : result.error().message.c_str());
        return false;
    }
    return true;
}

/// Columns and rows of the photograph.
inline constexpr std::uint32_t side = 64;

/// A camera 4 m to the right of the vehicle, which looks at it.
inline vg::Pose pose_at_right() {
    return {1, 0, 0, 0, 0, 0, 1, -4, 0, -1, 0, 0};
}

inline vg_camera camera_at_right() {
    return vg::pinhole(60, 60, side / 2.0, side / 2.0, side, side, pose_at_right()).take();
}

/// A picture of a ball, R G B: reddish, with no two channels or rows equal.
inline std::vector<std::uint8_t> ball_rgb() {
    std::vector<std::uint8_t> pixels;
    for (std::uint32_t v = 0; v < side; v++) {
        for (std::uint32_t u = 0; u < side; u++) {
            pixels.push_back(static_cast<std::uint8_t>(200 + v / 2));
            pixels.push_back(static_cast<std::uint8_t>(100 + u));
            pixels.push_back(static_cast<std::uint8_t>(20 + v));
        }
    }
    return pixels;
}

inline bool in_ball(std::uint32_t u, std::uint32_t v) {
    const double x = u + 0.5 - side / 2.0, y = v + 0.5 - side / 2.0;
    return x * x + y * y < 20.0 * 20.0;
}

inline std::vector<std::uint8_t> ball_mask() {
    std::vector<std::uint8_t> pixels;
    for (std::uint32_t v = 0; v < side; v++) {
        for (std::uint32_t u = 0; u < side; u++) {
            pixels.push_back(in_ball(u, v) ? 255 : 0);
        }
    }
    return pixels;
}

/// Depth of the near side of the ball, metres.
inline std::vector<float> ball_depth() {
    std::vector<float> metres;
    for (std::uint32_t v = 0; v < side; v++) {
        for (std::uint32_t u = 0; u < side; u++) {
            const double x = u + 0.5 - side / 2.0, y = v + 0.5 - side / 2.0;
            metres.push_back(in_ball(u, v) ? static_cast<float>(2.7 + (x * x + y * y) / 400.0) : 0.0F);
        }
    }
    return metres;
}

/// Whether two models are the same to the last bit.
inline bool same(const vg::Gaussians &a, const vg::Gaussians &b) {
    const auto equal = [](vg::Span<const float> x, vg::Span<const float> y) {
        return std::vector<float>(x.begin(), x.end()) == std::vector<float>(y.begin(), y.end());
    };
    return !a.empty() && a.sh_degree() == b.sh_degree() && equal(a.positions(), b.positions()) &&
           equal(a.scales(), b.scales()) && equal(a.rotations(), b.rotations()) &&
           equal(a.opacities(), b.opacities()) && equal(a.sh(), b.sh());
}

#endif // VG_TEST_HPP
