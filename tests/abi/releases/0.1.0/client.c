/*
 * A program written for release 0.1.0. It calls every function of that release and checks what it gets, with
 * nothing but the C library and threads. It is compiled against the header of its release, kept beside it, and
 * must link and run with every later library of the same ABI number. It is also today's C test: compiled as C and
 * as C++, linked against the shared and the static library, and run under Valgrind.
 *
 *     client SAMPLE_FOLDER SCRATCH_FOLDER [quick]
 *
 * Prints one line per buffer, "name count hash", which other bindings must print too.
 */
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "vg.h"

#define CHECK(condition)                                                        \
    do {                                                                        \
        if (!(condition)) {                                                     \
            fprintf(stderr, "%s:%d: not true: %s\n", __FILE__, __LINE__, #condition); \
            exit(1);                                                            \
        }                                                                       \
    } while (0)

/* A call that must succeed; `error` is in scope. */
#define DO(call)                                                                             \
    do {                                                                                     \
        vg_status done_ = (call);                                                            \
        if (done_ != VG_STATUS_OK || error != NULL) {                                        \
            fprintf(stderr, "%s:%d: %s: %s\n", __FILE__, __LINE__, #call, vg_error_message(error)); \
            exit(1);                                                                         \
        }                                                                                    \
    } while (0)

/* A call that must fail with this status and these words in its message. */
#define FAILS(call, status, words)                                                           \
    do {                                                                                     \
        CHECK((call) == (status));                                                           \
        CHECK(error != NULL && vg_error_code(error) == (status));                            \
        if (strstr(vg_error_message(error), words) == NULL) {                                \
            fprintf(stderr, "%s:%d: no \"%s\" in: %s\n", __FILE__, __LINE__, words, vg_error_message(error)); \
            exit(1);                                                                         \
        }                                                                                    \
        vg_error_free(error);                                                                \
        error = NULL;                                                                        \
    } while (0)

static const char *sample;
static const char *scratch;
static int quick;

static uint64_t hash_of(const void *data, size_t bytes) {
    const unsigned char *p = (const unsigned char *)data;
    uint64_t hash = 14695981039346656037u; /* FNV-1a */
    size_t i;
    for (i = 0; i < bytes; i++) {
        hash = (hash ^ p[i]) * 1099511628211u;
    }
    return hash;
}

static void print_hash(const char *name, const void *data, size_t bytes) {
    printf("%s %lu %016llx\n", name, (unsigned long)bytes, (unsigned long long)hash_of(data, bytes));
}

static int near_to(double a, double b, double tolerance) {
    return fabs(a - b) <= tolerance;
}

static void path_in(const char *folder, const char *name, char *out, size_t size) {
    int n = snprintf(out, size, "%s/%s", folder, name);
    CHECK(n > 0 && (size_t)n < size);
}

/* Callbacks record what they are told. */
typedef struct told {
    int calls;
    int stop_after;
    double last_fraction;
    char last_stage[32];
    int lines;
} told;

static int32_t on_progress(const char *stage, double fraction, void *user) {
    told *t = (told *)user;
    t->calls++;
    t->last_fraction = fraction;
    snprintf(t->last_stage, sizeof t->last_stage, "%s", stage);
    return t->stop_after > 0 && t->calls >= t->stop_after;
}

static void on_log(int32_t level, const char *message, void *user) {
    told *t = (told *)user;
    CHECK(level >= VG_LOG_LEVEL_WARNING && level <= VG_LOG_LEVEL_DEBUG && message[0] != '\0');
    t->lines++;
}

static void versions(void) {
    char expected[32];
    int major, minor, patch;
    snprintf(expected, sizeof expected, "%d.", VG_VERSION_MAJOR);
    CHECK(strncmp(vg_version(), expected, strlen(expected)) == 0);
    CHECK(sscanf(vg_version(), "%d.%d.%d", &major, &minor, &patch) == 3);
    CHECK(minor > VG_VERSION_MINOR || (minor == VG_VERSION_MINOR && patch >= VG_VERSION_PATCH));
    CHECK(vg_abi_version() == VG_ABI_VERSION);
    CHECK(vg_error_code(NULL) == VG_STATUS_OK);
    CHECK(strcmp(vg_error_message(NULL), "") == 0);
    CHECK(strcmp(vg_status_name(VG_STATUS_FORMAT), "VG_STATUS_FORMAT") == 0);
    CHECK(strcmp(vg_status_name(-1), "") == 0);
}

static void poses_and_cameras(void) {
    /* COLMAP's world turned by 90 degrees about z and moved; half the size of the vehicle's. */
    const double vehicle_from_world[16] = {0, -2, 0, 1, 2, 0, 0, 0, 0, 0, 2, 0.5, 0, 0, 0, 1};
    const double qvec[4] = {2, 0, 0, 0}, tvec[3] = {1, 2, 3};
    const double opengl[12] = {1, 0, 0, 4, 0, 1, 0, 5, 0, 0, 1, 6};
    const double identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    const double vehicle_in_ego[12] = {0, -1, 0, 500000, 1, 0, 0, 5400000, 0, 0, 1, 100};
    const double camera_in_ego[12] = {1, 0, 0, 500002, 0, 1, 0, 5400001, 0, 0, 1, 101};
    const double params[4] = {100, 110, 31.5, 24};
    const double k[9] = {100, 0, 31, 0, 110, 23.5, 0, 0, 1}, brown[5] = {0.1, 0.01, 0.001, 0.002, 0.003};
    const double point[3] = {0.5, -0.25, 2};
    double pose[12], pixel[2];
    vg_camera camera, other;
    vg_error *error = NULL;

    DO(vg_pose_from_colmap(qvec, tvec, NULL, pose, &error));
    CHECK(near_to(pose[0], 1, 1e-15) && near_to(pose[3], -1, 1e-15) && near_to(pose[11], -3, 1e-15));
    DO(vg_pose_from_colmap(qvec, tvec, vehicle_from_world, pose, &error));
    /* The centre (-1, -2, -3) goes to (4 + 1, -2, -6 + 0.5). */
    CHECK(near_to(pose[3], 5, 1e-14) && near_to(pose[7], -2, 1e-14) && near_to(pose[11], -5.5, 1e-14));
    CHECK(near_to(pose[1], -1, 1e-14) && near_to(pose[4], 1, 1e-14));

    DO(vg_pose_from_opengl(opengl, NULL, pose, &error));
    CHECK(pose[0] == 1 && pose[5] == -1 && pose[10] == -1 && pose[3] == 4 && pose[7] == 5 && pose[11] == 6);

    DO(vg_pose_from_box(vehicle_in_ego, camera_in_ego, pose, &error));
    CHECK(near_to(pose[3], 1, 1e-8) && near_to(pose[7], -2, 1e-8) && near_to(pose[11], 1, 1e-8));
    CHECK(near_to(pose[1], 1, 1e-15) && near_to(pose[4], -1, 1e-15));

    CHECK(vg_camera_init(&camera, sizeof camera) == VG_STATUS_OK);
    CHECK(camera.struct_size == sizeof camera && camera.model == VG_CAMERA_MODEL_PINHOLE);
    CHECK(memcmp(camera.vehicle_from_camera, identity, sizeof identity) == 0);
    DO(vg_camera_from_colmap_model(VG_CAMERA_MODEL_PINHOLE, params, 4, 63, 48, NULL, &camera, &error));
    CHECK(camera.width == 63 && camera.height == 48 && memcmp(camera.params, params, sizeof params) == 0);
    FAILS(vg_camera_from_colmap_model(9, params, 4, 63, 48, NULL, &camera, &error), VG_STATUS_ARGUMENT, "model");

    DO(vg_camera_from_opencv(k, NULL, 0, 0, 63, 48, NULL, &other, &error));
    CHECK(other.model == VG_CAMERA_MODEL_PINHOLE && memcmp(other.params, params, sizeof params) == 0);
    DO(vg_camera_from_opencv(k, brown, 5, 0, 63, 48, NULL, &other, &error));
    CHECK(other.model == VG_CAMERA_MODEL_FULL_OPENCV && other.params[8] == 0.003);

    DO(vg_camera_project(&camera, point, pixel, &error));
    CHECK(near_to(pixel[0], 100 * 0.25 + 31.5, 1e-12) && near_to(pixel[1], 110 * -0.125 + 24, 1e-12));
    DO(vg_camera_scale(&camera, 126, 96, &other, &error));
    CHECK(other.params[0] == 200 && other.params[2] == 63 && other.width == 126);
    DO(vg_camera_crop(&camera, 10, 8, 20, 16, &other, &error));
    CHECK(other.params[2] == 21.5 && other.params[3] == 16 && other.width == 20 && other.height == 16);
    FAILS(vg_camera_crop(&camera, 60, 0, 20, 16, &other, &error), VG_STATUS_ARGUMENT, "allowed");
}

/* Cameras that are placed by hand; points to pixels and back. */
static void placed_cameras(void) {
    const double eye[3] = {0, -5, 1}, target[3] = {0, 0, 1}, up[3] = {0, 0, 3};
    const double rvec[3] = {1.5707963267948966, 0, 0}, tvec[3] = {0, 1, 5};
    const double points[9] = {0.5, 0, 1, 0, -9, 1, 0, 0, 2}, pixel[2] = {32, 24};
    double pose[12], by_opencv[12], pixels[6], depths[3], back[9], point[3];
    vg_camera camera;
    vg_error *error = NULL;
    int i;

    DO(vg_pose_look_at(eye, target, NULL, pose, &error));
    CHECK(near_to(pose[0], 1, 1e-15) && near_to(pose[6], 1, 1e-15) && near_to(pose[9], -1, 1e-15) && pose[7] == -5);
    /* The same place as OpenCV has it: x stays, y goes to z, z goes to -y. */
    DO(vg_pose_from_opencv(rvec, tvec, NULL, by_opencv, &error));
    for (i = 0; i < 12; i++) {
        CHECK(near_to(pose[i], by_opencv[i], 1e-14));
    }
    DO(vg_camera_look_at(eye, target, up, 90, 64, 48, &camera, &error));
    CHECK(near_to(camera.params[0], 24, 1e-12) && camera.params[2] == 32 && camera.params[3] == 24);
    DO(vg_camera_project_points(&camera, points, 3, pixels, depths, &error));
    CHECK(near_to(pixels[0], 32 + 24 * 0.1, 1e-12) && near_to(pixels[1], 24, 1e-12) && near_to(depths[0], 5, 1e-12));
    CHECK(isnan(pixels[2]) && isnan(depths[1]) && near_to(pixels[5], 24 - 24 * 0.2, 1e-12));
    DO(vg_camera_unproject_points(&camera, pixels, depths, 3, back, &error));
    CHECK(near_to(back[0], 0.5, 1e-12) && isnan(back[3]) && near_to(back[8], 2, 1e-12));
    DO(vg_camera_unproject(&camera, pixel, 5, point, &error));
    CHECK(near_to(point[0], 0, 1e-12) && near_to(point[1], 0, 1e-12) && near_to(point[2], 1, 1e-12));
    FAILS(vg_camera_unproject(&camera, pixel, -1, point, &error), VG_STATUS_ARGUMENT, "depth_m: -1");
    FAILS(vg_pose_look_at(eye, eye, NULL, pose, &error), VG_STATUS_ARGUMENT, "target: ");
    FAILS(vg_camera_look_at(eye, target, up, 180, 64, 48, &camera, &error), VG_STATUS_ARGUMENT, "fov_y_degrees: 180");
}

static vg_scene *open_sample(vg_context *context, told *heard) {
    static const char *const names[4] = {"000", "001", "002", "003"};
    vg_scene_options options;
    vg_scene *scene = NULL;
    vg_error *error = NULL;
    CHECK(vg_scene_options_init(&options, sizeof options) == VG_STATUS_OK);
    options.context = context;
    options.names = names;
    options.name_count = 4;
    options.log = on_log;
    options.log_user = heard;
    DO(vg_transforms_open(sample, &options, &scene, &error));
    CHECK(vg_scene_view_count(scene) == 4);
    return scene;
}

static void colmap_without_a_folder(void) {
    vg_scene_options options;
    vg_scene *scene = NULL;
    vg_error *error = NULL;
    CHECK(vg_scene_options_init(&options, sizeof options) == VG_STATUS_OK);
    FAILS(vg_colmap_open("/nowhere/at/all", &options, &scene, &error), VG_STATUS_IO, "/nowhere/at/all");
    CHECK(scene == NULL);
    FAILS(vg_colmap_open(sample, &options, &scene, &error), VG_STATUS_FORMAT, "COLMAP");
    vg_scene_free(NULL);
}

/* In a build without networks that is the answer; with them, and no such file, another. */
static void models_without_a_file(const vg_view *views, size_t count, vg_context *context) {
    static uint8_t mask[1]; /* nothing is written without a model */
    vg_model_options settings;
    vg_segment_options segment;
    vg_options options;
    vg_model *model = (vg_model *)&settings;
    vg_gaussians *car = NULL;
    vg_error *error = NULL;
    vg_status built;

    CHECK(vg_model_options_init(&settings, sizeof settings) == VG_STATUS_OK);
    CHECK(settings.runtime == NULL && settings.provider == VG_PROVIDER_CPU && settings.fall_back == 0);
    CHECK(settings.threads == 0 && settings.prepack == VG_PREPACK_AUTO && settings.arena == 0);
    settings.threads = 2;
    built = vg_model_open("/nowhere/at/all.onnx", &settings, &model, NULL);
    CHECK(model == NULL && (built == VG_STATUS_NOT_BUILT || built == VG_STATUS_IO));
    FAILS(vg_model_open("/nowhere/at/all.onnx", NULL, &model, &error), built,
          built == VG_STATUS_IO ? "all.onnx" : "feature onnx");
    settings.provider = 9;
    FAILS(vg_model_open("x.onnx", &settings, &model, &error), VG_STATUS_ARGUMENT, "options.provider: 9");
    FAILS(vg_model_open(NULL, NULL, &model, &error), VG_STATUS_ARGUMENT, "path: NULL");
    vg_model_free(model);

    CHECK(vg_options_init(&options, sizeof options) == VG_STATUS_OK);
    CHECK(options.prior_model == NULL && options.head_model == NULL);
    options.prior = VG_PRIOR_ONNX;
    FAILS(vg_reconstruct(views, count, &options, &car, NULL, &error),
          built == VG_STATUS_IO ? VG_STATUS_ARGUMENT : VG_STATUS_NOT_BUILT, "options.prior");
    CHECK(car == NULL);

    CHECK(vg_segment_options_init(&segment, sizeof segment) == VG_STATUS_OK && segment.context == NULL);
    segment.context = context;
    FAILS(vg_segment(NULL, &views[0].image, &views[0].camera, &segment, mask, 7, &error), VG_STATUS_ARGUMENT,
          "row_stride: 7 bytes");
    FAILS(vg_segment(NULL, &views[0].image, &views[0].camera, &segment, NULL, 0, &error), VG_STATUS_ARGUMENT,
          "out_mask");
    FAILS(vg_segment(NULL, &views[0].image, &views[0].camera, NULL, mask, 0, &error),
          built == VG_STATUS_IO ? VG_STATUS_ARGUMENT : VG_STATUS_NOT_BUILT, "model");
    CHECK(mask[0] == 0);
}

static vg_gaussians *reconstruct(vg_context *context, const vg_view *views, size_t count) {
    vg_options options;
    vg_report_figures figures;
    vg_gaussians *car = NULL, *again = NULL;
    vg_report *report = NULL;
    vg_error *error = NULL;
    told heard = {0, 0, 0, "", 0};
    const float cloud[6] = {0, -0.9f, 0.6f, 0, (float)NAN, 0};
    size_t points;

    CHECK(vg_options_init(&options, sizeof options) == VG_STATUS_OK);
    options.context = context;
    options.points = 1;
    options.check = !quick;
    options.resolution = quick ? 0.5 : 1;
    options.progress = on_progress;
    options.progress_user = &heard;
    options.log = on_log;
    options.log_user = &heard;
    DO(vg_reconstruct(views, count, &options, &car, &report, &error));
    CHECK(heard.calls >= 6 && heard.last_fraction >= 0 && heard.last_fraction <= 1 && heard.lines > 6);
    CHECK(vg_gaussians_count(car) > (quick ? 3000 : 10000) && vg_gaussians_sh_degree(car) == 2);

    CHECK(vg_report_figures_init(&figures, sizeof figures) == VG_STATUS_OK);
    DO(vg_report_get_figures(report, &figures, &error));
    CHECK(figures.gaussian_count == vg_gaussians_count(car) && figures.views_used == 4);
    CHECK(figures.prior == VG_PRIOR_GIVEN && figures.sh_degree == 2 && figures.total_ms > 0);
    CHECK(figures.threads == vg_context_threads(context) && figures.has_input_error == !quick);
    CHECK(quick || (figures.input_psnr_db > 20 && figures.input_silhouette_iou > 0.9));
    CHECK(figures.extent_high[0] - figures.extent_low[0] > 3.5 && figures.extent_high[0] - figures.extent_low[0] < 6);
    CHECK(strstr(vg_report_json(report), "\"left_out\"") != NULL);
    CHECK(figures.verdict == (quick ? VG_VERDICT_UNCHECKED : VG_VERDICT_GOOD));
    CHECK(figures.reason_count == 0 && vg_report_reason(report, 0)[0] == '\0');
    CHECK(figures.input_given_psnr_db == figures.input_psnr_db);
    points = vg_report_point_count(report);
    CHECK(points > 1000 && isfinite(vg_report_point_positions(report)[3 * points - 1]));
    CHECK(vg_report_point_colors(report) != NULL);
    vg_report_free(report);

    heard.calls = 0;
    heard.stop_after = 3;
    report = (vg_report *)&heard;
    FAILS(vg_reconstruct(views, count, &options, &again, &report, &error), VG_STATUS_CANCELLED, heard.last_stage);
    CHECK(again == NULL && report == NULL);
    options.progress = NULL;
    CHECK(options.calibrate == VG_CALIBRATE_AUTO && options.relight == VG_RELIGHT_AUTO && options.photo == 1);
    CHECK(options.budget_s == 0 && options.cloud == NULL && options.cloud_count == 0);
    CHECK(options.resolution == (quick ? 0.5 : 1) && options.max_views == 0);
    CHECK(options.refine_seconds == 0 && options.refine_iterations == 0 && options.refine_hold_out == 0);
    options.refine_seconds = 1;
    options.refine_iterations = 2;
    FAILS(vg_reconstruct(views, count, &options, &again, NULL, &error), VG_STATUS_ARGUMENT, "options.refine_seconds: 1");
    options.refine_seconds = 0;
    options.resolution = 1.5;
    FAILS(vg_reconstruct(views, count, &options, &again, NULL, &error), VG_STATUS_ARGUMENT, "options.resolution: 1.5");
    options.resolution = 1;
    options.cloud_count = 2;
    FAILS(vg_reconstruct(views, count, &options, &again, NULL, &error), VG_STATUS_ARGUMENT, "options.cloud: NULL");
    options.cloud = cloud;
    FAILS(vg_reconstruct(views, count, &options, &again, NULL, &error), VG_STATUS_ARGUMENT, "options.cloud[1]");
    options.cloud_count = 1;
    options.prior = VG_PRIOR_SHAPE;
    options.calibrate = VG_CALIBRATE_OFF;
    options.relight = VG_RELIGHT_NEVER;
    options.photo = 0;
    options.budget_s = 1e6;
    if (!quick) {
        DO(vg_reconstruct(views, count, &options, &again, &report, &error));
        DO(vg_report_get_figures(report, &figures, &error));
        CHECK(figures.prior == VG_PRIOR_SHAPE && figures.calibration == VG_CALIBRATION_NONE && figures.has_uncovered);
        CHECK(figures.uncovered_after <= figures.uncovered_before && figures.uncovered_before < 0.2);
        CHECK(figures.refine_iterations == 2 && figures.refine_kept <= 2);
        CHECK(figures.relit_count == 0 && figures.photo_found == 0 && figures.cloud_used <= 1);
        vg_report_free(report);
        vg_gaussians_free(again);
        again = NULL;
    }
    return car;
}

/* Everything that makes new Gaussians of old ones. */
static void derive(const vg_gaussians *car) {
    const double turned[16] = {0, -1, 0, 10, 1, 0, 0, 20, 0, 0, 1, 0.5, 0, 0, 0, 1};
    const size_t n = vg_gaussians_count(car);
    const size_t sh = (size_t)(vg_gaussians_sh_degree(car) + 1) * (size_t)(vg_gaussians_sh_degree(car) + 1) * 3;
    const float *p = vg_gaussians_positions(car), *q;
    vg_gaussian_arrays arrays;
    vg_gaussians *moved = NULL, *mirrored = NULL, *twice = NULL, *both = NULL, *copy = NULL, *loaded = NULL;
    vg_error *error = NULL;
    char path[1024];

    DO(vg_gaussians_transform(car, turned, &moved, &error));
    q = vg_gaussians_positions(moved);
    CHECK(near_to(q[0], 10 - p[1], 2e-6) && near_to(q[1], 20 + p[0], 4e-6) && near_to(q[2], p[2] + 0.5, 1e-6));
    DO(vg_gaussians_mirror(car, &mirrored, &error));
    CHECK(vg_gaussians_positions(mirrored)[1] == -p[1]);
    DO(vg_gaussians_mirror(mirrored, &twice, &error));
    CHECK(memcmp(vg_gaussians_sh(twice), vg_gaussians_sh(car), n * sh * sizeof(float)) == 0);
    DO(vg_gaussians_merge(car, moved, &both, &error));
    CHECK(vg_gaussians_count(both) == 2 * n);
    CHECK(memcmp(vg_gaussians_positions(both) + 3 * n, q, n * 3 * sizeof(float)) == 0);

    CHECK(vg_gaussian_arrays_init(&arrays, sizeof arrays) == VG_STATUS_OK);
    arrays.count = n;
    arrays.sh_degree = vg_gaussians_sh_degree(car);
    arrays.positions = p;
    arrays.scales = vg_gaussians_scales(car);
    arrays.rotations = vg_gaussians_rotations(car);
    arrays.opacities = vg_gaussians_opacities(car);
    arrays.sh = vg_gaussians_sh(car);
    DO(vg_gaussians_from_arrays(&arrays, &copy, &error));
    CHECK(memcmp(vg_gaussians_scales(copy), arrays.scales, n * 3 * sizeof(float)) == 0);
    CHECK(memcmp(vg_gaussians_opacities(copy), arrays.opacities, n * sizeof(float)) == 0);
    arrays.sh_degree = 4;
    FAILS(vg_gaussians_from_arrays(&arrays, &loaded, &error), VG_STATUS_ARGUMENT, "sh_degree");

    path_in(scratch, "client.ply", path, sizeof path);
    DO(vg_gaussians_save_ply(car, path, &error));
    DO(vg_gaussians_load_ply(path, &loaded, &error));
    CHECK(vg_gaussians_count(loaded) == n);
    CHECK(memcmp(vg_gaussians_positions(loaded), p, n * 3 * sizeof(float)) == 0);
    path_in(scratch, "no/such/folder.ply", path, sizeof path);
    FAILS(vg_gaussians_save_ply(car, path, &error), VG_STATUS_IO, "folder.ply");

    vg_gaussians_free(moved);
    vg_gaussians_free(mirrored);
    vg_gaussians_free(twice);
    vg_gaussians_free(both);
    vg_gaussians_free(copy);
    vg_gaussians_free(loaded);
    vg_gaussians_free(NULL);
}

/* Parts of a model, what is computed of it, and its file in memory. */
static void parts(const vg_gaussians *car) {
    const size_t n = vg_gaussians_count(car), some[3] = {2, 0, 2};
    const size_t size = vg_gaussians_ply_size(car);
    const float *p = vg_gaussians_positions(car), *s = vg_gaussians_scales(car);
    const double low[3] = {0, -10, -10}, high[3] = {10, 10, 10};
    uint8_t *keep = (uint8_t *)calloc(n, 1), *file = (uint8_t *)malloc(size);
    float *covariances = (float *)malloc(n * 6 * sizeof(float));
    vg_camera around[3];
    vg_gaussians *part = NULL, *loaded = NULL;
    vg_error *error = NULL;
    size_t i, in_front = 0;

    DO(vg_gaussians_select(car, some, 3, &part, &error));
    CHECK(vg_gaussians_count(part) == 3 && memcmp(vg_gaussians_positions(part), p + 6, 3 * sizeof(float)) == 0);
    vg_gaussians_free(part);
    for (i = 0; i < n; i++) {
        keep[i] = p[3 * i] >= 0;
        in_front += keep[i];
    }
    DO(vg_gaussians_mask(car, keep, n, &part, &error));
    CHECK(vg_gaussians_count(part) == in_front && in_front > 0 && in_front < n);
    DO(vg_gaussians_crop(car, low, high, &loaded, &error));
    CHECK(vg_gaussians_count(loaded) == in_front);
    CHECK(memcmp(vg_gaussians_sh(loaded), vg_gaussians_sh(part), in_front * 27 * sizeof(float)) == 0);
    vg_gaussians_free(part);
    vg_gaussians_free(loaded);
    FAILS(vg_gaussians_mask(car, keep, n - 1, &part, &error), VG_STATUS_ARGUMENT, "keep_count");
    FAILS(vg_gaussians_crop(car, high, low, &part, &error), VG_STATUS_ARGUMENT, "low[0]");
    FAILS(vg_gaussians_select(car, &n, 1, &part, &error), VG_STATUS_ARGUMENT, "indices[0]");

    DO(vg_gaussians_covariances(car, covariances, n, &error));
    for (i = 0; i < n; i++) { /* a rotation keeps the trace */
        const double trace = (double)covariances[6 * i] + (double)covariances[6 * i + 3] + (double)covariances[6 * i + 5];
        const double squares = pow((double)s[3 * i], 2) + pow((double)s[3 * i + 1], 2) + pow((double)s[3 * i + 2], 2);
        CHECK(near_to(trace, squares, 1e-6 * squares));
    }
    FAILS(vg_gaussians_covariances(car, covariances, n + 1, &error), VG_STATUS_ARGUMENT, "count");

    DO(vg_gaussians_save_ply_memory(car, file, size, &error));
    DO(vg_gaussians_load_ply_memory(file, size, &loaded, &error));
    CHECK(vg_gaussians_count(loaded) == n && memcmp(file, "ply\n", 4) == 0);
    CHECK(memcmp(vg_gaussians_positions(loaded), p, n * 3 * sizeof(float)) == 0);
    vg_gaussians_free(loaded);
    FAILS(vg_gaussians_save_ply_memory(car, file, size - 1, &error), VG_STATUS_ARGUMENT, "size");
    FAILS(vg_gaussians_load_ply_memory(file, size - 1, &loaded, &error), VG_STATUS_FORMAT, "PLY in memory");

    DO(vg_cameras_turntable(car, 3, 12, 35, 64, 48, around, &error));
    for (i = 0; i < 3; i++) {
        CHECK(around[i].struct_size == sizeof around[i] && around[i].width == 64);
    }
    CHECK(around[0].vehicle_from_camera[3] > 3 && around[1].vehicle_from_camera[7] > 3);
    FAILS(vg_cameras_turntable(car, 0, 12, 35, 64, 48, around, &error), VG_STATUS_ARGUMENT, "count: 0");
    free(keep);
    free(file);
    free(covariances);
}

/* Moves the model's Gaussians towards the photographs. */
static void refine(const vg_gaussians *car, const vg_view *views, size_t count, vg_context *context) {
    vg_refine_options options;
    vg_refinement done;
    vg_gaussians *better = NULL;
    vg_error *error = NULL;
    told heard = {0, 0, 0, "", 0};

    CHECK(vg_refine_options_init(&options, sizeof options) == VG_STATUS_OK);
    CHECK(options.iterations == 300 && options.seconds == 0 && options.hold_out == 0 && options.densify == 0);
    CHECK(options.backend == VG_BACKEND_AUTO && options.progress == NULL && options.progress_user == NULL);
    options.context = context;
    options.iterations = 8;
    options.hold_out = 1;
    options.progress = on_progress;
    options.progress_user = &heard;
    CHECK(vg_refinement_init(&done, sizeof done) == VG_STATUS_OK && isnan(done.psnr_after_db));
    if (!quick) {
        DO(vg_refine(car, views, count, &options, &better, &done, &error));
        CHECK(vg_gaussians_count(better) == vg_gaussians_count(car) && heard.calls > 0 && heard.last_fraction <= 1);
        CHECK(done.iterations == options.iterations && done.made == done.iterations && done.kept <= done.made);
        CHECK(done.stop == VG_REFINE_STOP_DONE && done.psnr_after_db >= 15 && done.psnr_before_db >= 15);
        CHECK(done.held_out_before_db >= 15 && done.held_out_after_db >= done.held_out_before_db);
        vg_gaussians_free(better);

        heard.calls = 0;
        heard.stop_after = 1;
        FAILS(vg_refine(car, views, count, &options, &better, NULL, &error), VG_STATUS_CANCELLED, "refine");
        CHECK(better == NULL);
    }
    options.iterations = 1000001;
    FAILS(vg_refine(car, views, count, &options, &better, &done, &error), VG_STATUS_ARGUMENT, "options.iterations");
}

enum { WIDTH = 160, HEIGHT = 120, CALLERS = 8 };

typedef struct job {
    const vg_gaussians *car;
    const vg_camera *camera;
    vg_context *context;
    unsigned char *pixels;
} job;

static void *draw(void *user) {
    job *j = (job *)user;
    vg_render_options options;
    vg_image_target target;
    vg_error *error = NULL;
    CHECK(vg_render_options_init(&options, sizeof options) == VG_STATUS_OK);
    CHECK(vg_image_target_init(&target, sizeof target) == VG_STATUS_OK);
    options.context = j->context;
    target.width = WIDTH;
    target.height = HEIGHT;
    target.color = j->pixels;
    DO(vg_render(j->car, j->camera, &options, &target, &error));
    return NULL;
}

/* Two cameras in one call; the renderer holds on to the Gaussians, which are freed first. */
static void two_pictures_of_one_renderer(vg_context *context, const vg_gaussians *car, const vg_camera *camera,
                                         const unsigned char *expected) {
    static unsigned char drawn[2][WIDTH * HEIGHT * 4];
    vg_renderer_options settings;
    vg_render_options options;
    vg_image_target targets[2];
    vg_camera cameras[2];
    vg_gaussians *mirrored = NULL;
    vg_renderer *renderer = NULL;
    vg_error *error = NULL;
    int i;

    CHECK(vg_renderer_options_init(&settings, sizeof settings) == VG_STATUS_OK);
    CHECK(vg_render_options_init(&options, sizeof options) == VG_STATUS_OK);
    settings.context = options.context = context;
    settings.backend = VG_BACKEND_CPU;
    for (i = 0; i < 2; i++) {
        CHECK(vg_image_target_init(&targets[i], sizeof targets[i]) == VG_STATUS_OK);
        targets[i].width = WIDTH;
        targets[i].height = HEIGHT;
        targets[i].color = drawn[i];
        cameras[i] = *camera;
    }
    DO(vg_renderer_new(car, &settings, &renderer, &error));
    CHECK(vg_renderer_backend(renderer) == VG_BACKEND_CPU);
    CHECK(strstr(vg_renderer_choice(renderer), "asked for") != NULL);
    DO(vg_renderer_render(renderer, cameras, 2, &options, targets, &error));
    CHECK(memcmp(drawn[0], expected, sizeof drawn[0]) == 0 && memcmp(drawn[0], drawn[1], sizeof drawn[0]) == 0);
    targets[1].width = 1;
    FAILS(vg_renderer_render(renderer, cameras, 2, &options, targets, &error), VG_STATUS_ARGUMENT, "targets[1].size");
    vg_renderer_free(renderer);

    DO(vg_gaussians_mirror(car, &mirrored, &error));
    DO(vg_renderer_new(mirrored, &settings, &renderer, &error));
    vg_gaussians_free(mirrored);
    DO(vg_renderer_render(renderer, cameras, 1, &options, targets, &error));
    CHECK(memcmp(drawn[0], expected, sizeof drawn[0]) != 0);
    vg_renderer_free(renderer);
}

static void render(const vg_gaussians *car, const vg_camera *photograph, vg_context *context) {
    static unsigned char pictures[CALLERS][HEIGHT * WIDTH * 4], padded[HEIGHT][WIDTH * 4 + 20];
    static float colors[HEIGHT * WIDTH * 4], depth[HEIGHT * WIDTH];
    vg_camera camera;
    vg_render_options options;
    vg_image_target target;
    vg_error *error = NULL;
    pthread_t threads[CALLERS];
    job jobs[CALLERS];
    int i, covered = 0;

    DO(vg_camera_scale(photograph, WIDTH, HEIGHT, &camera, &error));
    for (i = 0; i < CALLERS; i++) {
        jobs[i].car = car;
        jobs[i].camera = &camera;
        jobs[i].context = context;
        jobs[i].pixels = pictures[i];
        CHECK(pthread_create(&threads[i], NULL, draw, &jobs[i]) == 0);
    }
    for (i = 0; i < CALLERS; i++) {
        CHECK(pthread_join(threads[i], NULL) == 0);
        CHECK(memcmp(pictures[0], pictures[i], sizeof pictures[0]) == 0);
    }
    print_hash("render_rgba8", pictures[0], sizeof pictures[0]);

    CHECK(vg_render_options_init(&options, sizeof options) == VG_STATUS_OK);
    CHECK(vg_image_target_init(&target, sizeof target) == VG_STATUS_OK);
    options.context = context;
    options.background = VG_BACKGROUND_TRANSPARENT;
    target.width = WIDTH;
    target.height = HEIGHT;
    target.color = padded;
    target.color_row_stride = sizeof padded[0];
    target.depth = depth;
    memset(padded, 77, sizeof padded);
    DO(vg_render(car, &camera, &options, &target, &error));
    target.color = colors;
    target.color_row_stride = 0;
    target.color_format = VG_FORMAT_RGBA32F;
    options.alpha = VG_ALPHA_PREMULTIPLIED;
    DO(vg_render(car, &camera, &options, &target, &error));
    for (i = 0; i < HEIGHT * WIDTH; i++) {
        int row = i / WIDTH, column = i % WIDTH;
        float alpha = colors[4 * i + 3];
        CHECK(alpha >= 0 && alpha <= 1 && (alpha > 0) == (depth[i] > 0));
        CHECK(abs((int)padded[row][4 * column + 3] - (int)lrintf(255 * alpha)) <= 1);
        CHECK(padded[row][WIDTH * 4 + column % 20] == 77);
        covered += alpha > 0.5f;
    }
    CHECK(covered > WIDTH * HEIGHT / 20 && covered < WIDTH * HEIGHT);

    target.color_format = VG_FORMAT_RGB8;
    FAILS(vg_render(car, &camera, &options, &target, &error), VG_STATUS_ARGUMENT, "color_format");
    options.backend = VG_BACKEND_GPU;
    CHECK(vg_render(car, &camera, &options, &target, NULL) != VG_STATUS_OK);
    two_pictures_of_one_renderer(context, car, &camera, pictures[0]);
}

enum { SIDE = 32 };

/* What a loss needs: the picture, what it should be, and where to put the gradient. */
typedef struct fit {
    float picture[SIDE * SIDE * 4], wanted[SIDE * SIDE * 4], gradient[SIDE * SIDE * 3];
    double loss;
    int calls, answer;
} fit;

/* Half the sum of squared differences. */
static int32_t squared(void *user) {
    fit *f = (fit *)user;
    int i, c;
    f->loss = 0;
    f->calls++;
    for (i = 0; i < SIDE * SIDE; i++) {
        for (c = 0; c < 3; c++) {
            const float difference = f->picture[4 * i + c] - f->wanted[4 * i + c];
            f->gradient[3 * i + c] = difference;
            f->loss += 0.5 * difference * difference;
        }
    }
    return f->answer;
}

/* Two Gaussians are fitted to a picture of others by steps down the gradient. */
static void go_back(vg_context *context) {
    static fit f;
    static float plane[SIDE * SIDE];
    float positions[6] = {-0.25f, 0, 2, 0.2f, 0.1f, 2.2f}, scales[6] = {0.2f, 0.3f, 0.2f, 0.3f, 0.2f, 0.2f};
    float rotations[8] = {2, 0, 0, 0, 1, 1, 0, 0}, opacities[2] = {0.7f, 0.6f};
    float sh[6] = {0.5f, -0.5f, 0, -0.2f, 0.9f, 0.3f};
    float d_positions[8] = {0, 0, 0, 0, 0, 0, 77, 77}, d_scales[6], d_rotations[8], d_opacities[2], d_sh[6];
    double background[3], pose[6], view_matrix[16], first = 0, along;
    vg_camera camera;
    vg_render_options options;
    vg_image_target target;
    vg_image_gradient gradient;
    vg_gradients out;
    vg_gaussian_arrays arrays;
    vg_gaussians *wanted = NULL, *pair = NULL;
    vg_error *error = NULL;
    int i, step;

    CHECK(vg_camera_init(&camera, sizeof camera) == VG_STATUS_OK);
    camera.width = camera.height = SIDE;
    camera.params[0] = camera.params[1] = SIDE;
    camera.params[2] = camera.params[3] = SIDE / 2;
    CHECK(vg_render_options_init(&options, sizeof options) == VG_STATUS_OK);
    options.context = context;
    CHECK(vg_image_target_init(&target, sizeof target) == VG_STATUS_OK);
    CHECK(target.alpha == NULL && target.alpha_row_stride == 0);
    target.width = target.height = SIDE;
    target.color_format = VG_FORMAT_RGBA32F;
    target.color = f.wanted;
    CHECK(vg_gaussian_arrays_init(&arrays, sizeof arrays) == VG_STATUS_OK);
    arrays.count = 2;
    arrays.positions = positions;
    arrays.scales = scales;
    arrays.rotations = rotations;
    arrays.opacities = opacities;
    arrays.sh = sh;
    DO(vg_gaussians_from_arrays(&arrays, &wanted, &error));
    DO(vg_render(wanted, &camera, &options, &target, &error));
    positions[0] += 0.1f;
    positions[4] -= 0.1f;

    CHECK(vg_image_gradient_init(&gradient, sizeof gradient) == VG_STATUS_OK);
    CHECK(gradient.color == NULL && gradient.loss == NULL && gradient.loss_user == NULL);
    gradient.width = gradient.height = SIDE;
    gradient.color = f.gradient;
    gradient.loss = squared;
    gradient.loss_user = &f;
    CHECK(vg_gradients_init(&out, sizeof out) == VG_STATUS_OK);
    CHECK(out.count == 0 && out.positions == NULL && out.view_matrix == NULL);
    out.count = 2;
    out.positions = d_positions;
    target.color = f.picture;
    for (step = 0; step < 40; step++) {
        DO(vg_gaussians_from_arrays(&arrays, &pair, &error));
        DO(vg_render_backward(pair, &camera, &options, &target, &gradient, &out, &error));
        CHECK(f.calls == step + 1 && d_positions[6] == 77 && d_positions[7] == 77);
        first = step == 0 ? f.loss : first;
        for (i = 0; i < 6; i++) {
            positions[i] -= 2e-3f * d_positions[i];
        }
        vg_gaussians_free(pair);
    }
    CHECK(first > 0.1 && f.loss < first / 10);

    /* Everything, of alpha, without a picture; what was given out before stays where it is not wanted. */
    gradient.loss = NULL;
    gradient.color = NULL;
    gradient.alpha = plane;
    for (i = 0; i < SIDE * SIDE; i++) {
        plane[i] = i % SIDE < SIDE / 2 ? 1.0f : -1.0f;
    }
    out.positions = NULL;
    out.scales = d_scales;
    out.rotations = d_rotations;
    out.opacities = d_opacities;
    out.sh = d_sh;
    out.background = background;
    out.pose = pose;
    out.view_matrix = view_matrix;
    DO(vg_render_backward(wanted, &camera, &options, NULL, &gradient, &out, &error));
    /* More of the left, less of the right: the left one should be more opaque, and the camera look to the left. */
    CHECK(d_opacities[0] > 1 && d_opacities[1] < -1 && pose[3] > 1 && view_matrix[15] == 0);
    for (i = 0; i < 6; i++) {
        CHECK(d_sh[i] == 0 && isfinite(d_scales[i]) && isfinite(pose[i]));
    }
    along = d_rotations[4] + d_rotations[5]; /* perpendicular to the quaternion */
    CHECK(near_to(along, 0, 1e-4) && background[0] == 0);

    out.count = 3;
    FAILS(vg_render_backward(wanted, &camera, &options, NULL, &gradient, &out, &error), VG_STATUS_ARGUMENT, "out.count: 3");
    out.count = 2;
    plane[SIDE + 3] = (float)NAN;
    FAILS(vg_render_backward(wanted, &camera, &options, NULL, &gradient, &out, &error), VG_STATUS_ARGUMENT,
          "gradient.alpha[1][3]: NaN");
    gradient.loss = squared;
    FAILS(vg_render_backward(wanted, &camera, &options, NULL, &gradient, &out, &error), VG_STATUS_ARGUMENT, "target: NULL");
    f.answer = 1;
    FAILS(vg_render_backward(wanted, &camera, &options, &target, &gradient, &out, &error), VG_STATUS_CANCELLED, "loss");
    vg_gaussians_free(wanted);
}

/* The model against what it was made of, and against its own centres. */
static void measure(const vg_gaussians *car, const vg_view *view, vg_context *context) {
    vg_metrics_options options;
    vg_picture_errors pictures;
    vg_view_errors seen;
    vg_surface_errors surface;
    vg_error *error = NULL;
    const float *centres = vg_gaussians_positions(car);
    size_t count = vg_gaussians_count(car);

    CHECK(vg_metrics_options_init(&options, sizeof options) == VG_STATUS_OK);
    CHECK(options.lpips == NULL && options.f_score_m == 0.05);
    options.context = context;
    CHECK(vg_picture_errors_init(&pictures, sizeof pictures) == VG_STATUS_OK && isnan(pictures.ssim));
    CHECK(vg_view_errors_init(&seen, sizeof seen) == VG_STATUS_OK && isnan(seen.ssim));
    CHECK(vg_surface_errors_init(&surface, sizeof surface) == VG_STATUS_OK && isnan(surface.f_score));
    DO(vg_metrics_pictures(&view->image, &view->image, &options, &pictures, &error));
    CHECK(isinf(pictures.psnr_db) && pictures.ssim == 1 && isnan(pictures.lpips));
    DO(vg_metrics_view(car, view, &options, &seen, &error));
    CHECK(seen.psnr_db > 15 && seen.psnr_box_db > 10 && seen.ssim > 0.5 && seen.silhouette_iou > 0.9);
    CHECK(isnan(seen.lpips) && seen.depth_mae_m < 0.1 && seen.depth_p90_m >= seen.depth_mae_m / 10);
    DO(vg_metrics_surface(car, centres, count, &options, &surface, &error));
    CHECK(surface.accuracy_m < 0.05 && surface.completeness_m < 0.1 && surface.precision > 0.9);
    CHECK(near_to(surface.chamfer_m, 0.5 * (surface.accuracy_m + surface.completeness_m), 1e-9));
    CHECK(surface.f_score > 0.5 && surface.length_error_percent < 10 && surface.width_error_percent < 10);
    CHECK(surface.recall > 0.5 && surface.height_error_percent < 10);

    options.f_score_m = 0;
    FAILS(vg_metrics_surface(car, centres, count, &options, &surface, &error), VG_STATUS_ARGUMENT, "options.f_score_m: 0");
    FAILS(vg_metrics_surface(car, NULL, 3, NULL, &surface, &error), VG_STATUS_ARGUMENT, "points: NULL");
    FAILS(vg_metrics_view(car, view, NULL, NULL, &error), VG_STATUS_ARGUMENT, "out: NULL");
    FAILS(vg_metrics_pictures(NULL, &view->image, NULL, &pictures, &error), VG_STATUS_ARGUMENT, "a: NULL");
}

/* The sample's cameras, which stand in the vehicle's frame, back into it from a world of twice the size. */
static void align(const vg_view *views, size_t count, vg_context *context) {
    static const double places[6][3] = {{0, 0, 0}, {4, 0, 0}, {0, 2, 0}, {0, 0, 2}, {4, 2, 0}, {4, 2, 2}};
    double world[6][3], residuals[6];
    uint8_t kept[6];
    float scan[3][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    double size[3] = {4.5, 1.8, 1.5};
    vg_align_options options;
    vg_alignment found;
    vg_error *error = NULL;
    size_t i, k;

    CHECK(vg_align_options_init(&options, sizeof options) == VG_STATUS_OK && options.heading == VG_HEADING_AUTO);
    options.context = context;
    CHECK(vg_alignment_init(&found, sizeof found) == VG_STATUS_OK && isnan(found.scale) && found.used_count == 0);
    for (i = 0; i < 6; i++) {
        for (k = 0; k < 3; k++) {
            world[i][k] = 2 * places[i][k] + (double)k;
        }
    }
    DO(vg_align_points(&world[0][0], &places[0][0], 6, &found, kept, residuals, &error));
    CHECK(near_to(found.scale, 0.5, 1e-12) && found.confidence == 1 && found.residual_m < 1e-12);
    CHECK(found.used_count == 6 && isnan(found.residual_px) && isnan(found.other_px));
    CHECK(near_to(found.vehicle_from_world[0], 0.5, 1e-12) && near_to(found.vehicle_from_world[7], -0.5, 1e-12));
    for (i = 0; i < 6; i++) {
        CHECK(kept[i] == 1 && residuals[i] < 1e-12);
    }
    world[5][1] += 1;
    DO(vg_align_points(&world[0][0], &places[0][0], 6, &found, kept, NULL, &error));
    CHECK(found.used_count == 5 && kept[5] == 0 && kept[0] == 1);
    FAILS(vg_align_points(&world[0][0], &places[0][0], 2, &found, NULL, NULL, &error), VG_STATUS_ARGUMENT, "count: 2");

    FAILS(vg_align_scan(views, count, NULL, 0, &scan[0][0], 3, &options, &found, &error), VG_STATUS_ARGUMENT, "scan: 3 points");
    FAILS(vg_align_box(views, count, NULL, 0, size, &options, &found, &error), VG_STATUS_ARGUMENT, "sparse: 0 points");
    options.heading = VG_HEADING_BACKWARD + 1;
    FAILS(vg_align_folder(sample, "no.ply", &options, &found, &error), VG_STATUS_ARGUMENT, "options.heading: 3");
    options.heading = VG_HEADING_FORWARD;
    FAILS(vg_align_folder(sample, "no.ply", &options, &found, &error), VG_STATUS_IO, "no.ply");
    FAILS(vg_align_folder(sample, NULL, &options, &found, &error), VG_STATUS_ARGUMENT, "scan_path: ");
}

int main(int argc, char **argv) {
    vg_context_options settings;
    vg_context *context = NULL;
    vg_scene *scene;
    vg_view views[4];
    vg_gaussians *car;
    vg_error *error = NULL;
    told heard = {0, 0, 0, "", 0};
    size_t i, n;

    CHECK(argc >= 3);
    sample = argv[1];
    scratch = argv[2];
    quick = argc > 3;

    versions();
    poses_and_cameras();
    placed_cameras();
    CHECK(vg_context_options_init(&settings, sizeof settings) == VG_STATUS_OK);
    settings.threads = 2;
    DO(vg_context_new(&settings, &context, &error));
    CHECK(vg_context_threads(context) == 2);

    colmap_without_a_folder();
    scene = open_sample(context, &heard);
    for (i = 0; i < 4; i++) {
        CHECK(vg_view_init(&views[i], sizeof views[i]) == VG_STATUS_OK);
        DO(vg_scene_get_view(scene, i, &views[i], &error));
        CHECK(views[i].image.data != NULL && views[i].mask.data != NULL && views[i].depth.data != NULL);
    }
    FAILS(vg_scene_get_view(scene, 4, &views[0], &error), VG_STATUS_ARGUMENT, "index");

    models_without_a_file(views, 4, context);
    car = reconstruct(context, views, 4);
    n = vg_gaussians_count(car);
    print_hash("positions", vg_gaussians_positions(car), n * 3 * sizeof(float));
    print_hash("scales", vg_gaussians_scales(car), n * 3 * sizeof(float));
    print_hash("rotations", vg_gaussians_rotations(car), n * 4 * sizeof(float));
    print_hash("opacities", vg_gaussians_opacities(car), n * sizeof(float));
    print_hash("sh", vg_gaussians_sh(car), n * 27 * sizeof(float));
    derive(car);
    parts(car);
    refine(car, views, 4, context);
    render(car, &views[0].camera, context);
    align(views, 4, context);
    measure(car, &views[0], context);
    go_back(context);

    vg_scene_free(scene);
    vg_gaussians_free(car);
    vg_report_free(NULL);
    vg_context_free(context);
    vg_context_free(NULL);
    vg_default_context_free();
    vg_error_free(NULL);
    return 0;
}
