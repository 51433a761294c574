// A robot that stops for obstacles: c++ -std=c++11 stop.cpp $(pkg-config --cflags --libs svl)
// A made-up camera replaces a real one: a textured wall comes nearer by 0.2 m per pair.
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

struct Camera {
    static constexpr uint32_t width = 320, height = 240;
    std::vector<uint8_t> pixels[2] = {std::vector<uint8_t>(width * height), std::vector<uint8_t>(width * height)};
    svl_image left{pixels[0].data(), width, height, 0, SVL_GRAY8}, right{pixels[1].data(), width, height, 0, SVL_GRAY8};
    uint64_t stamp_ns = 0;

    bool next() {
        const double distance_m = 1.5 - 2e-9 * static_cast<double>(stamp_ns);
        const uint32_t disparity = static_cast<uint32_t>(std::lround(328 * 0.044 / distance_m));
        for (uint32_t i = 0; i < width * height; ++i) {
            pixels[0][i] = texture(i % width, i / width);
            pixels[1][i] = texture(i % width + disparity, i / width);
        }
        stamp_ns += 100000000;
        return stamp_ns <= 600000000;
    }
};

int main() try {
    Camera camera;
    svl_options options = SVL_OPTIONS;
    options.algorithm = "v5:max_disparity=64";
    options.focal_px = 328, options.baseline_m = 0.044, options.cx_px = 160, options.cy_px = 120;
    svl_handle *opened;
    check(svl_open(&options, &opened));
    std::unique_ptr<svl_handle, void (*)(svl_handle *)> svl(opened, svl_close);
    while (camera.next()) {
        check(svl_match(svl.get(), &camera.left, &camera.right, camera.stamp_ns));
        const svl_cell *cells;
        uint32_t columns, rows;
        check(svl_cells(svl.get(), &cells, &columns, &rows));
        float nearest_m = INFINITY;
        for (uint32_t i = 0; i < columns * rows; ++i)
            nearest_m = std::fmin(nearest_m, cells[i].state == SVL_NEAR ? 0 : cells[i].distance_m);
        std::printf("nearest %.2f m: %s\n", nearest_m, nearest_m < 0.5f ? "stop" : "go on");
    }
    return 0;
} catch (const std::exception &error) {
    std::fprintf(stderr, "svl: %s\n", error.what());
    return 1;
}
