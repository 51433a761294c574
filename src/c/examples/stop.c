/* A robot that stops for obstacles: cc stop.c $(pkg-config --cflags --libs svl)
 * A made-up camera replaces a real one: a textured wall comes nearer by 0.2 m per pair. */
#include "svl.h"
#include <math.h>
#include <stdio.h>

enum { WIDTH = 320, HEIGHT = 240 };

static uint8_t texture(uint32_t x, uint32_t y) {
    return (uint8_t)(((x * 0x9E3779B9u ^ y * 0x85EBCA6Bu) * 0xC2B2AE35u) >> 24);
}

/* The camera's next pair, and its time; 0 at the end. */
static int next_pair(svl_image pair[2], uint64_t *stamp_ns) {
    static uint8_t pixels[2][WIDTH * HEIGHT];
    static uint32_t step = 0;
    uint32_t disparity = (uint32_t)lround(328 * 0.044 / (1.5 - 0.2 * step));
    for (uint32_t i = 0; i < WIDTH * HEIGHT; i++) {
        pixels[0][i] = texture(i % WIDTH, i / WIDTH);
        pixels[1][i] = texture(i % WIDTH + disparity, i / WIDTH);
    }
    for (int side = 0; side < 2; side++) pair[side] = (svl_image){pixels[side], WIDTH, HEIGHT, 0, SVL_GRAY8};
    *stamp_ns = 100000000u * ++step;
    return step <= 6;
}

static int failed(void) {
    fprintf(stderr, "svl: %s\n", svl_error());
    return 1;
}

int main(void) {
    svl_options options = SVL_OPTIONS;
    options.algorithm = "v5:max_disparity=64";
    options.focal_px = 328, options.baseline_m = 0.044, options.cx_px = 160, options.cy_px = 120;
    svl_handle *svl;
    if (svl_open(&options, &svl)) return failed();
    svl_image pair[2];
    uint64_t stamp_ns;
    while (next_pair(pair, &stamp_ns)) {
        const svl_cell *cells;
        uint32_t columns, rows;
        if (svl_match(svl, &pair[0], &pair[1], stamp_ns)) return failed();
        if (svl_cells(svl, &cells, &columns, &rows)) return failed();
        float nearest_m = INFINITY;
        for (uint32_t i = 0; i < columns * rows; i++) /* fminf passes over NAN, the distance of an unknown cell. */
            nearest_m = fminf(nearest_m, cells[i].state == SVL_NEAR ? 0 : cells[i].distance_m);
        printf("nearest %.2f m: %s\n", nearest_m, nearest_m < 0.5f ? "stop" : "go on");
    }
    svl_close(svl);
    return 0;
}
