// Makes a model of the vehicle from a COLMAP folder.
//
//     colmap_vehicle FOLDER VEHICLE_FROM_WORLD.json CAR.ply [IMAGE...]
//
// FOLDER has COLMAP's model in sparse/0, photographs in images/ and masks in masks/. COLMAP's world has an
// arbitrary pose and scale, so the similarity to the vehicle's frame is needed too, a 4x4 matrix in a JSON
// file; `vg align` finds it. IMAGE...: the photographs to use; default: all.
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>

#include <vg.hpp>

// Returns the value, or ends the program with the error.
template <class T> T must(vg::Result<T> result) {
    if (!result) {
        std::fprintf(stderr, "colmap_vehicle: %s\n", result.error().message.c_str());
        std::exit(1);
    }
    return result.take();
}

// Reads the 16 numbers of {"vehicle_from_world": [[...], [...], [...], [...]]} and ignores the rest.
static vg::Similarity read_similarity(const std::string &path) {
    std::ifstream file(path);
    const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    vg::Similarity similarity{};
    std::size_t found = 0;
    const std::size_t first = text.find('[');
    const char *at = first == std::string::npos ? "" : text.c_str() + first;
    while (found < similarity.size() && *at != '\0') {
        char *end = nullptr;
        const double number = std::strtod(at, &end);
        if (end == at) {
            at++; // a bracket or a comma
        } else {
            similarity[found++] = number;
            at = end;
        }
    }
    if (found != similarity.size()) {
        std::fprintf(stderr, "colmap_vehicle: %s: no 4x4 matrix\n", path.c_str());
        std::exit(1);
    }
    return similarity;
}

int main(int argc, char **argv) {
    if (argc < 4) {
        std::fprintf(stderr, "usage: colmap_vehicle FOLDER VEHICLE_FROM_WORLD.json CAR.ply [IMAGE...]\n");
        return 2;
    }
    const vg::Similarity vehicle_from_world = read_similarity(argv[2]);
    const auto print = [](vg_log_level level, const char *line) {
        if (level <= VG_LOG_LEVEL_INFO) {
            std::printf("%s%s\n", level == VG_LOG_LEVEL_WARNING ? "warning: " : "", line);
        }
    };

    vg::SceneOptions scene_options;
    scene_options.vehicle_from_world = vehicle_from_world.data();
    scene_options.view_names.assign(argv + 4, argv + argc);
    scene_options.on_log = print;
    const vg::Scene scene = must(vg::Scene::open_colmap(argv[1], scene_options));

    vg::Options options;
    options.on_log = print;
    const vg::Reconstruction made = must(vg::reconstruct(must(scene.views()), options));
    must(made.gaussians.save_ply(argv[3]));

    const vg_report_figures figures = made.report.figures();
    std::printf(
        "%s: %zu Gaussians of %u views, of them %zu mirrored; %.2f x %.2f x %.2f m; %.0f ms\n", argv[3],
        made.gaussians.size(), figures.views_used, static_cast<std::size_t>(figures.mirrored_count),
        figures.extent_high[0] - figures.extent_low[0], figures.extent_high[1] - figures.extent_low[1],
        figures.extent_high[2] - figures.extent_low[2], figures.total_ms);
    std::printf("on the photographs themselves: %.1f dB, silhouettes overlap by %.3f\n",
                figures.input_psnr_db, figures.input_silhouette_iou);
    // made.report.json() has more: times by stage, what was left out and why.
    return 0;
}
