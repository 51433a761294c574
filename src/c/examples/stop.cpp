// The same from C++, with a made-up pair: a textured wall that comes nearer.
// c++ -std=c++11 stop.cpp -I include libsvl_c.a -lpthread -ldl -lm
#include "svl.h"
#include <cmath>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <vector>

static void check(svl_status status) {
    if (status != SVL_OK) throw std::runtime_error(svl_error());
}

static uint8_t texture(uint32_t x, uint32_t y) {
    return static_cast<uint8_t>(((x * 0x9E3779B9u ^ y * 0x85EBCA6Bu) * 0xC2B2AE35u) >> 24);
}

int main() try {
    const uint32_t width = 320, height = 240;
    svl_options options = SVL_OPTIONS;
    options.algorithm = "v5:max_disparity=64";
    options.focal_px = 328;
    options.baseline_m = 0.044;
    svl_handle *opened;
    check(svl_open(&options, &opened));
    std::unique_ptr<svl_handle, void (*)(svl_handle *)> svl(opened, svl_close);
    std::vector<uint8_t> left(width * height), right(width * height);
    const svl_image images[] = {{left.data(), width, height, 0, SVL_GRAY8}, {right.data(), width, height, 0, SVL_GRAY8}};
    for (double distance_m = 1.5; distance_m > 0.4; distance_m -= 0.2) {
        const uint32_t disparity = static_cast<uint32_t>(std::lround(328 * 0.044 / distance_m));
        for (uint32_t i = 0; i < width * height; ++i) {
            left[i] = texture(i % width, i / width);
            right[i] = texture(i % width + disparity, i / width);
        }
        check(svl_match(svl.get(), &images[0], &images[1], 0));
        const svl_cell *cells;
        uint32_t columns, rows;
        check(svl_cells(svl.get(), &cells, &columns, &rows));
        float nearest = INFINITY;
        for (uint32_t i = 0; i < columns * rows; ++i)
            nearest = std::fmin(nearest, cells[i].state == SVL_NEAR ? 0 : cells[i].distance_m);
        std::printf("nearest %.2f m: %s\n", nearest, nearest < 0.5f ? "stop" : "go on");
    }
    return 0;
} catch (const std::exception &error) {
    std::fprintf(stderr, "svl: %s\n", error.what());
    return 1;
}
