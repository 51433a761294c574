/* A robot that stops for obstacles: cc stop.c -I include libsvl_c.a -lpthread -ldl -lm; ./a.out LEFT.pgm RIGHT.pgm */
#include "svl.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* Reads a binary PGM of 8 bits; NULL if the file is not one. */
static uint8_t *read_pgm(const char *path, unsigned *width, unsigned *height) {
    FILE *file = fopen(path, "rb");
    uint8_t *pixels = NULL;
    if (file && fscanf(file, "P5 %u %u 255", width, height) == 2 && fgetc(file) != EOF && *width <= 16384 && *height <= 16384) {
        size_t size = (size_t)*width * *height;
        pixels = malloc(size);
        if (pixels && fread(pixels, 1, size, file) != size) { free(pixels); pixels = NULL; }
    }
    if (file) fclose(file);
    return pixels;
}

int main(int argc, char **argv) {
    unsigned width, height, right_width, right_height;
    uint8_t *left = argc > 2 ? read_pgm(argv[1], &width, &height) : NULL;
    uint8_t *right = left ? read_pgm(argv[2], &right_width, &right_height) : NULL;
    if (!right || width != right_width || height != right_height) {
        fprintf(stderr, "usage: stop LEFT.pgm RIGHT.pgm, of equal sizes\n");
        return 2;
    }
    svl_options options = SVL_OPTIONS;
    options.algorithm = "v5:max_disparity=64";
    options.focal_px = 328, options.baseline_m = 0.044, options.cx_px = 160, options.cy_px = 120;
    svl_image images[] = {{left, width, height, 0, SVL_GRAY8}, {right, width, height, 0, SVL_GRAY8}};
    svl_handle *svl;
    const svl_cell *cells;
    uint32_t columns, rows;
    if (svl_open(&options, &svl) || svl_match(svl, &images[0], &images[1], 0) || svl_cells(svl, &cells, &columns, &rows)) {
        fprintf(stderr, "svl: %s\n", svl_error());
        return 1;
    }
    float nearest = INFINITY;
    for (uint32_t i = 0; i < columns * rows; i++) {
        if (cells[i].state == SVL_UNKNOWN) printf("%-12s", cells[i].reason ? svl_reason_name(cells[i].reason) : "uncertain");
        else if (cells[i].state == SVL_NEAR) printf("near    %.2f ", cells[i].probability);
        else printf("%5.2f m %.2f ", cells[i].distance_m, cells[i].probability);
        if ((i + 1) % columns == 0) printf("\n");
        float distance = cells[i].state == SVL_NEAR ? 0 : cells[i].distance_m;
        if (distance < nearest) nearest = distance;
    }
    printf("nearest %.2f m: %s\n", nearest, nearest < 0.5f ? "stop" : "go on");
    svl_close(svl);
    free(left);
    free(right);
    return 0;
}
