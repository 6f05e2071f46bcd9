/*
 * Handles of the parent in a forked child, while other threads of the parent work: contexts give an error
 * and are freed without waiting, calls without a context give the same picture, and nothing hangs.
 *
 *     fork
 */
#define _DEFAULT_SOURCE
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "vg.h"

enum { WIDTH = 64, HEIGHT = 48, FORKS = 12 };

static vg_gaussians *ball;
static vg_camera camera;
static volatile int done;

static void check(int holds, const char *what) {
    if (!holds) {
        fprintf(stderr, "not true: %s\n", what);
        _exit(1);
    }
}

#define CHECK(condition) check((condition), #condition)

static vg_status draw(vg_context *context, unsigned char *picture, vg_error **error) {
    vg_render_options options;
    vg_image_target target;
    CHECK(vg_render_options_init(&options, sizeof options) == VG_STATUS_OK);
    CHECK(vg_image_target_init(&target, sizeof target) == VG_STATUS_OK);
    options.context = context;
    target.width = WIDTH;
    target.height = HEIGHT;
    target.color = picture;
    return vg_render(ball, &camera, &options, &target, error);
}

/* Takes and releases all locks of the library, continuously. */
static void *busy(void *context) {
    unsigned char picture[4 * WIDTH * HEIGHT];
    while (!done) {
        CHECK(draw(NULL, picture, NULL) == VG_STATUS_OK);
        CHECK(draw((vg_context *)context, picture, NULL) == VG_STATUS_OK);
        vg_default_context_free();
    }
    return NULL;
}

static void child(vg_context *const contexts[2], const unsigned char *expected) {
    unsigned char picture[4 * WIDTH * HEIGHT];
    vg_context *own = NULL;
    int i;
    alarm(20);
    for (i = 0; i < 2; i++) {
        vg_error *error = NULL;
        CHECK(draw(contexts[i], picture, &error) == VG_STATUS_ARGUMENT);
        CHECK(strstr(vg_error_message(error), "options.context: made in process ") != NULL);
        CHECK(strstr(vg_error_message(error), "is a fork of it; allowed: one made after the fork") != NULL);
        vg_error_free(error);
        CHECK(vg_context_threads(contexts[i]) == 0);
        vg_context_free(contexts[i]);
    }
    CHECK(draw(NULL, picture, NULL) == VG_STATUS_OK && memcmp(picture, expected, sizeof picture) == 0);
    CHECK(vg_context_new(NULL, &own, NULL) == VG_STATUS_OK);
    CHECK(draw(own, picture, NULL) == VG_STATUS_OK && memcmp(picture, expected, sizeof picture) == 0);
    vg_context_free(own);
    vg_default_context_free();
    _exit(0);
}

int main(void) {
    static const float position[3] = {0, 0, 0}, scale[3] = {0.5f, 0.3f, 0.2f}, rotation[4] = {1, 0, 0, 0};
    static const float opacity[1] = {1}, sh[3] = {1, 0.5f, 0};
    static const double lens[4] = {60, 60, WIDTH / 2.0, HEIGHT / 2.0};
    static const double pose[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, -3};
    unsigned char expected[4 * WIDTH * HEIGHT];
    vg_gaussian_arrays arrays;
    vg_context_options settings;
    vg_context *contexts[2] = {NULL, NULL};
    pthread_t thread;
    int i;
    CHECK(vg_gaussian_arrays_init(&arrays, sizeof arrays) == VG_STATUS_OK);
    arrays.count = 1;
    arrays.positions = position;
    arrays.scales = scale;
    arrays.rotations = rotation;
    arrays.opacities = opacity;
    arrays.sh = sh;
    CHECK(vg_gaussians_from_arrays(&arrays, &ball, NULL) == VG_STATUS_OK);
    CHECK(vg_camera_from_colmap_model(1, lens, 4, WIDTH, HEIGHT, pose, &camera, NULL) == VG_STATUS_OK);
    for (i = 0; i < 2; i++) {
        CHECK(vg_context_options_init(&settings, sizeof settings) == VG_STATUS_OK);
        settings.threads = (uint32_t)(i + 1);
        CHECK(vg_context_new(&settings, &contexts[i], NULL) == VG_STATUS_OK);
        CHECK(vg_context_threads(contexts[i]) == (uint32_t)(i + 1));
    }
    CHECK(draw(NULL, expected, NULL) == VG_STATUS_OK);
    CHECK(pthread_create(&thread, NULL, busy, contexts[1]) == 0);
    for (i = 0; i < FORKS; i++) {
        int status = 0;
        pid_t pid = fork();
        CHECK(pid >= 0);
        if (pid == 0) {
            child(contexts, expected);
        }
        CHECK(waitpid(pid, &status, 0) == pid);
        CHECK(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    }
    done = 1;
    CHECK(pthread_join(thread, NULL) == 0);
    vg_context_free(contexts[0]);
    vg_context_free(contexts[1]);
    vg_gaussians_free(ball);
    vg_default_context_free();
    return 0;
}
