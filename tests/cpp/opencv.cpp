// vg.hpp with OpenCV: the accepted kinds of cv::Mat, that it is not copied, and the order of channels.
#include <opencv2/core.hpp>

#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include "vg_test.hpp"

#ifndef VG_HAS_OPENCV
#error "vg.hpp did not find OpenCV"
#endif

namespace {

static_assert(std::is_convertible_v<cv::Mat &, vg::LentMat> &&
              std::is_convertible_v<const cv::Mat1b &, vg::LentMat>);
static_assert(!std::is_convertible_v<cv::Mat, vg::LentMat>, "the pixels of a temporary would be gone");

constexpr int columns = static_cast<int>(side);

cv::Mat as_mat(const std::vector<std::uint8_t> &pixels, int type) {
    return cv::Mat(columns, columns, type, const_cast<std::uint8_t *>(pixels.data())).clone();
}

cv::Mat as_mat(const std::vector<float> &metres) {
    return cv::Mat(columns, columns, CV_32FC1, const_cast<float *>(metres.data())).clone();
}

/// Exchanges channels without cvtColor, which is in another library.
cv::Mat reordered(const cv::Mat &from, int type, const std::vector<int> &pairs) {
    cv::Mat to(from.rows, from.cols, type, cv::Scalar::all(255));
    cv::mixChannels(&from, 1, &to, 1, pairs.data(), pairs.size() / 2);
    return to;
}

/// Places the pixels inside a larger picture of other pixels.
cv::Mat in_larger(const cv::Mat &mat) {
    cv::Mat larger(mat.rows + 7, mat.cols + 9, mat.type(), cv::Scalar::all(77));
    cv::Mat region = larger(cv::Rect(5, 3, mat.cols, mat.rows));
    mat.copyTo(region);
    return region;
}

vg::Gaussians model(const vg_view &view) {
    return std::move(vg::reconstruct({view}).take().gaussians);
}

struct Mats {
    cv::Mat rgb = as_mat(ball_rgb(), CV_8UC3);
    cv::Mat bgr = reordered(rgb, CV_8UC3, {0, 2, 1, 1, 2, 0});
    cv::Mat mask = as_mat(ball_mask(), CV_8UC1);
    cv::Mat metres = as_mat(ball_depth());
};

vg::Gaussians the_same_bytes_in_every_layout(const Mats &mats) {
    const vg_camera camera = camera_at_right();
    vg_view view = vg::view(mats.bgr, mats.mask, mats.metres, camera).take();
    CHECK(view.image.data == mats.bgr.data && view.image.row_stride == 3 * side);
    vg::Gaussians car = model(view);

    view.image = vg::image_rgb(mats.rgb).take();
    CHECK(same(car, model(view)));

    // Regions of larger pictures: neither contiguous nor aligned.
    const cv::Mat bgr = in_larger(mats.bgr), mask = in_larger(mats.mask), metres = in_larger(mats.metres);
    CHECK(!bgr.isContinuous());
    const vg_view region = vg::view(bgr, mask, metres, camera).take();
    CHECK(region.image.data == bgr.data && region.image.row_stride == 3 * (side + 9));
    CHECK(same(car, model(region)));

    // Alpha instead of a mask.
    cv::Mat bgra = reordered(mats.bgr, CV_8UC4, {0, 0, 1, 1, 2, 2});
    const int to_alpha[2] = {0, 3};
    cv::mixChannels(&mats.mask, 1, &bgra, 1, to_alpha, 1);
    vg_view cut_out = vg::view(bgra, camera).take();
    cut_out.depth = view.depth;
    CHECK(cut_out.image.format == VG_FORMAT_BGRA8 && cut_out.mask.data == nullptr);
    CHECK(same(car, model(cut_out)));

    const cv::Mat gray(columns, columns, CV_8UC1, cv::Scalar(90));
    CHECK(vg::view(gray, mats.mask, camera)->image.format == VG_FORMAT_GRAY8);
    return car;
}

void other_types_are_errors_that_name_them(const Mats &mats) {
    const vg_camera camera = camera_at_right();
    const cv::Mat sixteen(columns, columns, CV_16UC3), empty,
        cube(3, std::vector<int>{4, 5, 6}.data(), CV_8UC1);
    const cv::Mat millimetres(columns, columns, CV_16UC1);
    CHECK(failed(vg::view(sixteen, mats.mask, camera), VG_STATUS_ARGUMENT,
                 "image: 64x64 of CV_16UC3, allowed: CV_8UC3"));
    CHECK(failed(vg::view(empty, mats.mask, camera), VG_STATUS_ARGUMENT, "image: an empty cv::Mat"));
    CHECK(failed(vg::view(mats.bgr, empty, camera), VG_STATUS_ARGUMENT, "mask: an empty cv::Mat"));
    CHECK(failed(vg::view(mats.bgr, mats.bgr, camera), VG_STATUS_ARGUMENT,
                 "mask: 64x64 of CV_8UC3, allowed: CV_8UC1"));
    CHECK(failed(vg::view(mats.bgr, mats.mask, millimetres, camera), VG_STATUS_ARGUMENT,
                 "depth: 64x64 of CV_16UC1, allowed: CV_32FC1 in metres (of other units: vg::metres)"));
    const cv::Mat opacity(columns, columns, CV_32FC1);
    CHECK(failed(vg::view(mats.bgr, opacity, camera), VG_STATUS_ARGUMENT, "of 0 to 1: mat.convertTo"));
    CHECK(failed(vg::view(mats.bgr, cube, camera), VG_STATUS_ARGUMENT, "mask: 3 dimensions of CV_8UC1"));
    CHECK(failed(vg::image_rgb(mats.mask), VG_STATUS_ARGUMENT, "allowed: CV_8UC3 (RGB)"));
}

void depth_in_millimetres_is_the_same_in_metres(const Mats &mats, const vg::Gaussians &car) {
    // Whole millimetres, so that nothing is rounded.
    cv::Mat millimetres, whole;
    mats.metres.convertTo(millimetres, CV_16U, 1000);
    millimetres.convertTo(whole, CV_32F, 0.001);
    const cv::Mat measured = vg::metres(millimetres).take();
    CHECK(measured.type() == CV_32FC1 && !(cv::norm(measured, whole, cv::NORM_INF) > 0));
    CHECK(!(cv::norm(measured, mats.metres, cv::NORM_INF) > 0.00051));
    const vg_view view = vg::view(mats.bgr, mats.mask, measured, camera_at_right()).take();
    CHECK(model(view).size() == car.size());

    // The unit of another sensor, and floats.
    const cv::Mat tenths = vg::metres(millimetres, 0.0001).take();
    CHECK(!(cv::norm(10 * tenths, measured, cv::NORM_INF) > 1e-5));
    CHECK(vg::metres(1000 * mats.metres)->type() == CV_32FC1);
    for (const double odd : {0.0, -0.001, std::numeric_limits<double>::quiet_NaN(), 1e7}) {
        CHECK(failed(vg::metres(millimetres, odd), VG_STATUS_ARGUMENT, "metres_per_unit: "));
    }
    CHECK(failed(vg::metres(mats.bgr), VG_STATUS_ARGUMENT, "depth: 64x64 of CV_8UC3, allowed: CV_16UC1"));
    CHECK(failed(vg::metres(cv::Mat()), VG_STATUS_ARGUMENT, "depth: "));
}

void photographs_without_masks_are_lent(const Mats &mats) {
    const vg::Model none;
    const vg_camera camera = camera_at_right();
    // The library's message: the picture is valid, the network is missing.
    CHECK(vg::segment(none, mats.bgr, camera).error().message.find("model: ") == 0);
    CHECK(failed(vg::segment(none, mats.metres, camera), VG_STATUS_ARGUMENT, "CV_32FC1"));
}

void pictures_go_into_matrices(const vg::Gaussians &car) {
    const vg_camera camera = camera_at_right();
    const vg::Picture expected = vg::render(car, camera, {}, VG_FORMAT_BGR8).take();
    const cv::Mat bgr = as_mat(expected.color, CV_8UC3), metres = as_mat(expected.depth);
    const auto equal = [](const cv::Mat &a, const cv::Mat &b) {
        return a.size() == b.size() && a.type() == b.type() && !(cv::norm(a, b, cv::NORM_INF) > 0);
    };

    cv::Mat color, depth;
    CHECK(vg::render_into(color, car, camera).ok() && equal(color, bgr));
    color.release();
    CHECK(vg::render_into(color, depth, car, camera).ok() && equal(color, bgr) && equal(depth, metres));

    cv::Mat larger(columns + 4, columns + 6, CV_8UC3, cv::Scalar::all(77));
    cv::Mat region = larger(cv::Rect(2, 1, columns, columns));
    const std::uint8_t *pixels = region.data;
    CHECK(vg::render_into(region, car, camera).ok());
    CHECK(region.data == pixels && equal(region, bgr) && larger.at<cv::Vec3b>(0, 0)[0] == 77);

    vg::RenderOptions transparent;
    transparent.background = VG_BACKGROUND_TRANSPARENT;
    cv::Mat bgra;
    CHECK(vg::render_into(bgra, car, camera, transparent).ok() && bgra.type() == CV_8UC4);
    CHECK(bgra.at<cv::Vec4b>(0, 0)[3] == 0 && bgra.at<cv::Vec4b>(columns / 2, columns / 2)[3] > 200);

    CHECK(failed(vg::render_into(region, car, camera, transparent), VG_STATUS_ARGUMENT,
                 "color: 64x64 of CV_8UC3"));
    CHECK(failed(vg::render_into(larger, car, camera), VG_STATUS_ARGUMENT,
                 "color: 70x68 of CV_8UC3, allowed: 64x64"));
    CHECK(failed(vg::render_into(color, bgra, car, camera), VG_STATUS_ARGUMENT, "depth: 64x64 of CV_8UC4"));
    cv::Mat untouched;
    transparent.blur = -1;
    CHECK(failed(vg::render_into(untouched, car, camera, transparent), VG_STATUS_ARGUMENT, "blur"));
    CHECK(untouched.empty());
}

/// Floats, alpha, and a renderer for many pictures.
void pictures_of_floats_and_of_renderers_go_into_matrices(const vg::Gaussians &car) {
    const vg_camera camera = camera_at_right();
    vg::RenderOptions transparent;
    transparent.background = vg::Background::Transparent;
    cv::Mat bytes, floats(columns, columns, CV_32FC4, cv::Scalar::all(7)), depth, alpha;
    CHECK(vg::render_into(bytes, car, camera, transparent).ok());
    const float *memory = floats.ptr<float>();
    CHECK(vg::render_into(floats, depth, alpha, car, camera, transparent).ok());
    CHECK(floats.ptr<float>() == memory && alpha.type() == CV_32FC1 && depth.type() == CV_32FC1);
    // B G R A as the bytes are, to half a step of them.
    cv::Mat rounded;
    floats.convertTo(rounded, CV_8U, 255);
    CHECK(!(cv::norm(rounded, bytes, cv::NORM_INF) > 1));
    cv::Mat fourth;
    cv::extractChannel(floats, fourth, 3);
    CHECK(!(cv::norm(fourth, alpha, cv::NORM_INF) > 0));
    CHECK(alpha.at<float>(columns / 2, columns / 2) > 0.8F && !(alpha.at<float>(0, 0) > 0));

    const vg::Renderer renderer = vg::Renderer::make(car).take();
    cv::Mat by_renderer, its_depth;
    CHECK(vg::render_into(by_renderer, its_depth, renderer, camera, transparent).ok());
    CHECK(!(cv::norm(by_renderer, bytes, cv::NORM_INF) > 0) && !(cv::norm(its_depth, depth, cv::NORM_INF) > 0));
    std::vector<cv::Mat> pictures;
    const vg_camera other = vg::placed(camera, {1, 0, 0, 0, 0, 0, 1, -5, 0, -1, 0, 0});
    CHECK(vg::render_into(pictures, renderer, {camera, other}, transparent).ok());
    CHECK(pictures.size() == 2 && !(cv::norm(pictures[0], bytes, cv::NORM_INF) > 0));
    CHECK(cv::norm(pictures[1], bytes, cv::NORM_INF) > 0);

    CHECK(failed(vg::render_into(alpha, renderer, camera), VG_STATUS_ARGUMENT,
                 "color: 64x64 of CV_32FC1, allowed: 64x64 of CV_8UC3, CV_8UC4 or CV_32FC4, or empty"));
    CHECK(failed(vg::render_into(bytes, depth, bytes, car, camera), VG_STATUS_ARGUMENT, "alpha: 64x64 of CV_8UC4"));
    pictures.assign(1, alpha);
    CHECK(failed(vg::render_into(pictures, renderer, {other, camera}), VG_STATUS_ARGUMENT, "color: "));
    CHECK(pictures.size() == 1 && pictures[0].data == alpha.data);
}

void calibrations_are_taken_as_opencv_leaves_them() {
    const cv::Mat k = (cv::Mat_<double>(3, 3) << 100, 0, 31, 0, 110, 23.5, 0, 0, 1);
    const cv::Mat row = (cv::Mat_<double>(1, 5) << 0.1, 0.01, 0.001, 0.002, 0.003);
    cv::Mat k32, column = row.t();
    k.convertTo(k32, CV_32F);
    const cv::Size size(63, 48);
    const vg_camera plain = vg::camera_from_opencv(k32, cv::Mat(), vg::Lens::Standard, size).take();
    CHECK(plain.model == VG_CAMERA_MODEL_PINHOLE && !(plain.params[2] < 31.5) && !(plain.params[2] > 31.5));
    for (const cv::Mat &distortion : {row, column}) {
        const vg_camera camera =
            vg::camera_from_opencv(k, distortion, vg::Lens::Standard, size, pose_at_right()).take();
        CHECK(camera.model == VG_CAMERA_MODEL_FULL_OPENCV && camera.params[4] > 0.0999 &&
              camera.params[4] < 0.1001);
        CHECK(camera.vehicle_from_camera[7] < -3.9);
    }
    const cv::Vec3d rvec(1.5707963267948966, 0, 0);
    const cv::Mat tvec = (cv::Mat_<float>(1, 3) << 0, 1, 5);
    const vg::Pose pose = vg::pose_from_opencv(cv::Mat(rvec), tvec).take();
    CHECK(pose[7] < -4.999 && pose[7] > -5.001 && pose[6] > 0.999);
    CHECK(failed(vg::pose_from_opencv(k, tvec), VG_STATUS_ARGUMENT, "rvec: 3x3 of CV_64FC1"));
    CHECK(failed(vg::pose_from_opencv(tvec, cv::Mat()), VG_STATUS_ARGUMENT, "tvec: "));
    CHECK(failed(vg::camera_from_opencv(row, row, vg::Lens::Standard, size), VG_STATUS_ARGUMENT,
                 "k: 5x1 of CV_64FC1"));
    CHECK(failed(vg::camera_from_opencv(k, k, vg::Lens::Standard, size), VG_STATUS_ARGUMENT,
                 "distortion: 3x3"));
    CHECK(failed(vg::camera_from_opencv(k, row, vg::Lens::Standard, cv::Size(-1, 4)), VG_STATUS_ARGUMENT,
                 "-1x4"));
}

} // namespace

int main() {
    const Mats mats;
    const vg::Gaussians car = the_same_bytes_in_every_layout(mats);
    other_types_are_errors_that_name_them(mats);
    depth_in_millimetres_is_the_same_in_metres(mats, car);
    photographs_without_masks_are_lent(mats);
    pictures_go_into_matrices(car);
    pictures_of_floats_and_of_renderers_go_into_matrices(car);
    calibrations_are_taken_as_opencv_leaves_them();
    return 0;
}
