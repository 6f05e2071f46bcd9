// Renders the left side of a vehicle from photographs of its right side, with OpenCV.
//
//     opencv_onesided FOLDER OUT_FOLDER [--no-depth] [--show]
//
// FOLDER is a nerfstudio scene: transforms.json, photographs, masks, and depth where it was measured. Views
// from the right of the vehicle (y < 0) are used; for those from the left, OUT_FOLDER/<name>.png is drawn.
#include <cstdio>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/highgui.hpp>
#include <opencv2/imgcodecs.hpp>
#define VG_HPP_EXCEPTIONS // take() of what failed throws; colmap_vehicle.cpp does without
#include <vg.hpp>

struct Frame {
    std::string image, mask, depth;
    vg_camera camera;
};

// Reads the cameras, to show where each number goes. For a calibration by OpenCV use
// vg::camera_from_opencv, which handles OpenCV's different centre of the first pixel; for tracked boxes use
// vg::pose_from_box.
static std::vector<Frame> read_frames(const std::string &folder) {
    std::vector<Frame> frames;
    const cv::FileStorage json(folder + "/transforms.json", cv::FileStorage::READ);
    for (const cv::FileNode &node : json["frames"]) {
        vg::Pose camera_to_world{};
        for (int i = 0; i < 12; i++) {
            camera_to_world[static_cast<std::size_t>(i)] = node["transform_matrix"][i / 4][i % 4].real();
        }
        Frame frame;
        frame.image = node["file_path"].string();
        frame.mask = node["mask_path"].string();
        frame.depth = node["depth_file_path"].empty() ? "" : node["depth_file_path"].string();
        const vg::Pose pose = vg::pose_from_opengl(camera_to_world).take();
        frame.camera = vg::pinhole(node["fl_x"].real(), node["fl_y"].real(), node["cx"].real(),
                                   node["cy"].real(), static_cast<std::uint32_t>(node["w"].real()),
                                   static_cast<std::uint32_t>(node["h"].real()), pose)
                           .take();
        frames.push_back(frame);
    }
    return frames;
}

static int run(int argc, char **argv) {
    bool with_depth = true, show = false;
    for (int i = 3; i < argc; i++) {
        with_depth = with_depth && std::string(argv[i]) != "--no-depth";
        show = show || std::string(argv[i]) == "--show";
    }
    if (argc < 3) {
        std::fprintf(stderr, "usage: opencv_onesided FOLDER OUT_FOLDER [--no-depth] [--show]\n");
        return 2;
    }
    const std::string folder = std::string(argv[1]) + "/", out_folder = std::string(argv[2]) + "/";

    // The matrices keep the pixels that the views point to.
    std::vector<cv::Mat> kept;
    std::vector<vg_view> views;
    std::vector<Frame> unseen;
    for (const Frame &frame : read_frames(argv[1])) {
        if (frame.camera.vehicle_from_camera[7] > 0) { // y of the camera's position
            unseen.push_back(frame);
            continue;
        }
        const cv::Mat photograph = cv::imread(folder + frame.image, cv::IMREAD_COLOR);
        const cv::Mat mask = cv::imread(folder + frame.mask, cv::IMREAD_GRAYSCALE);
        kept.insert(kept.end(), {photograph, mask});
        if (with_depth && !frame.depth.empty()) {
            // CV_16U, millimetres.
            const cv::Mat depth = vg::metres(cv::imread(folder + frame.depth, cv::IMREAD_UNCHANGED)).take();
            kept.push_back(depth);
            views.push_back(vg::view(photograph, mask, depth, frame.camera).take());
        } else {
            views.push_back(vg::view(photograph, mask, frame.camera).take());
        }
    }

    // All calls share one set of threads.
    const vg::Context context = vg::Context::make().take();
    vg::Options options;
    options.context = context.get();
    const vg::Reconstruction made = vg::reconstruct(views, options).take();
    std::printf("%zu Gaussians in %.0f ms\n", made.gaussians.size(), made.report.figures().total_ms);

    vg::RenderOptions render_options;
    render_options.context = context.get();
    for (const Frame &frame : unseen) {
        cv::Mat picture; // CV_8UC3, BGR
        vg::render_into(picture, made.gaussians, frame.camera, render_options).take();
        const std::string stem = frame.image.substr(frame.image.find_last_of('/') + 1);
        const std::string path = out_folder + stem.substr(0, stem.find_last_of('.')) + ".png";
        if (!cv::imwrite(path, picture)) {
            std::fprintf(stderr, "opencv_onesided: %s cannot be written\n", path.c_str());
            return 1;
        }
        std::printf("%s\n", path.c_str());
        if (show) {
            cv::imshow("the side that was not photographed", picture);
            cv::waitKey();
        }
    }
    return 0;
}

int main(int argc, char **argv) {
    try {
        return run(argc, argv);
    } catch (const vg::Exception &error) {
        std::fprintf(stderr, "opencv_onesided: %s\n", error.what());
        return 1;
    }
}
