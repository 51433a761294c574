// Stereo matchers in C++17 for svl. One file, nothing to link:
//
//     // mine.cpp
//     #include "svl_matcher.hpp"
//
//     int main() {
//       svl::Hello hello;
//       hello.name = "mine";
//       return svl::serve(hello, [](const svl::Pair& pair, svl::Answer& answer) {
//         for (int i = 0; i < pair.width * pair.height; i++) answer.disparity[i] = 16.0f;
//       });
//     }
//
//     g++ -O3 -o mine mine.cpp
//     svl score arena --algo v5 --algo "mine=exec:command=./mine"
//
// An installed svl prints this file: svl algos exec --example cpp > svl_matcher.hpp
//
// Disparities are in pixels: the left pixel (x, y) with disparity d shows what the right pixel (x - d, y)
// does. What is not written stays svl::none. What the function throws is the pair's error in svl's report;
// what it prints goes to standard error. The first pair of a size is matched once before it is timed.

#ifndef SVL_MATCHER_HPP
#define SVL_MATCHER_HPP

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <limits>
#include <string>
#include <unistd.h>
#include <vector>

namespace svl {

// No disparity.
constexpr float none = std::numeric_limits<float>::infinity();

// What the program is, for the run's manifest. All of it may be empty.
struct Hello {
  std::string name, version, device, isa, model;
  int threads = 1;
  // Whether it wants colour: three bytes a pixel, red, green, blue.
  bool color = false;
};

// Intrinsics of the rectified left camera in pixels, baseline in metres; all 0 where not known.
struct Rig {
  double focal_px = 0, cx_px = 0, cy_px = 0, baseline_m = 0, doffs_px = 0;
};

// A rectified pair, row by row without gaps, and what svl asks for.
struct Pair {
  int width = 0, height = 0, channels = 1;
  const uint8_t* left = nullptr;
  const uint8_t* right = nullptr;
  // Disparities are searched from the one to the other.
  int min_disparity = 0, max_disparity = 0;
  // Shape of the depth grid.
  int columns = 0, rows = 0;
  // How many threads may be used.
  int threads = 1;
  // Number of the pair in its run.
  uint64_t sequence = 0;
  // Of a pair that has one.
  std::string name;
  Rig rig;
};

// A cell of the depth grid.
struct Cell {
  float disparity = none;
  // From 0 to 1; negative where it is not known.
  float probability = -1;
};

struct Answer {
  // width * height, row by row; none everywhere at first.
  float* disparity = nullptr;
  // columns * rows, row by row, or empty: then svl makes the cells of the disparities.
  std::vector<Cell> cells;
};

namespace detail {

// The value behind "key": in a line of JSON, nullptr without one. Quotes within texts are escaped, so that
// a text cannot hold the pattern.
inline const char* find(const std::string& line, const char* key) {
  const std::string pattern = '"' + std::string(key) + "\":";
  const size_t at = line.find(pattern);
  return at == std::string::npos ? nullptr : line.c_str() + at + pattern.size();
}

inline double number(const std::string& line, const char* key, double otherwise = 0) {
  const char* at = find(line, key);
  return at ? std::strtod(at, nullptr) : otherwise;
}

inline std::string text(const std::string& line, const char* key) {
  const char* at = find(line, key);
  std::string found;
  if (!at || *at != '"') return found;
  for (at++; *at && *at != '"'; at++) {
    if (*at == '\\' && at[1]) at++;
    found += *at;
  }
  return found;
}

inline std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += static_cast<unsigned char>(c) < 32 ? ' ' : c;
  }
  return out + '"';
}

// Standard input, with a small buffer for lines; pixels go past it.
class Input {
 public:
  // False at the end of the input.
  bool read_line(std::string& line) {
    line.clear();
    for (;;) {
      if (from == to && !fill()) return false;
      const char c = buffer[from++];
      if (c == '\n') return true;
      line += c;
    }
  }

  bool read_all(uint8_t* at, size_t count) {
    const size_t held = std::min(count, to - from);
    std::memcpy(at, buffer + from, held);
    from += held, at += held, count -= held;
    while (count > 0) {
      const ssize_t got = ::read(0, at, count);
      if (got <= 0) return false;
      at += got, count -= static_cast<size_t>(got);
    }
    return true;
  }

 private:
  bool fill() {
    const ssize_t got = ::read(0, buffer, sizeof buffer);
    from = 0, to = got > 0 ? static_cast<size_t>(got) : 0;
    return got > 0;
  }

  char buffer[4096];
  size_t from = 0, to = 0;
};

inline bool write_all(int file, const void* from, size_t count) {
  for (auto* at = static_cast<const char*>(from); count > 0;) {
    const ssize_t put = ::write(file, at, count);
    if (put <= 0) return false;
    at += put, count -= static_cast<size_t>(put);
  }
  return true;
}

inline std::string hello_line(const Hello& hello) {
  std::string out = "{\"hello\":{\"threads\":" + std::to_string(hello.threads) +
                    ",\"color\":" + (hello.color ? "true" : "false");
  const auto add = [&](const char* key, const std::string& value) {
    if (!value.empty()) out += ",\"" + std::string(key) + "\":" + quoted(value);
  };
  add("name", hello.name), add("version", hello.version), add("device", hello.device);
  add("isa", hello.isa), add("model", hello.model);
  return out + "}}\n";
}

inline std::string reply_line(const std::string& seq, double millis, const std::vector<Cell>& cells) {
  char word[64];
  std::snprintf(word, sizeof word, "%.6f", millis);
  std::string out = "{\"seq\":" + seq + ",\"millis\":" + word;
  for (size_t i = 0; i < cells.size(); i++) {
    out += i ? "," : ",\"cells\":[";
    if (!std::isfinite(cells[i].disparity)) {
      out += "null";
      continue;
    }
    std::snprintf(word, sizeof word, "{\"disparity_px\":%.6g", cells[i].disparity);
    out += word;
    if (cells[i].probability >= 0) {
      std::snprintf(word, sizeof word, ",\"probability\":%.6g", cells[i].probability);
      out += word;
    }
    out += '}';
  }
  return out + (cells.empty() ? "}\n" : "]}\n");
}

}  // namespace detail

// Answers svl's requests with function(pair, answer) until its input ends; returns the exit status.
template <class Function>
int serve(const Hello& hello, Function function) {
  using namespace detail;
  using Clock = std::chrono::steady_clock;
  if (isatty(0)) {
    std::fputs("answers svl on its standard input: svl score arena --algo \"mine=exec:command=./mine\"\n",
               stderr);
    return 2;
  }
  // Standard output is for answers alone: what else is printed goes to standard error.
  const int target = dup(1);
  dup2(2, 1);
  Input input;
  std::string line;
  std::vector<uint8_t> images;
  std::vector<float> disparities;
  Pair pair;
  Answer answer;
  bool is_first = true;
  int warm_width = 0, warm_height = 0;
  while (input.read_line(line)) {
    const auto whole = [&](const char* key) { return static_cast<int>(number(line, key)); };
    pair.width = whole("width"), pair.height = whole("height"), pair.channels = whole("channels");
    pair.min_disparity = whole("min_disparity"), pair.max_disparity = whole("max_disparity");
    pair.columns = whole("columns"), pair.rows = whole("rows"), pair.threads = whole("threads");
    pair.sequence = static_cast<uint64_t>(number(line, "sequence"));
    pair.name = text(line, "name");
    pair.rig = {number(line, "focal_px"), number(line, "cx_px"), number(line, "cy_px"),
                number(line, "baseline_m"), number(line, "doffs_px")};
    const size_t pixels = static_cast<size_t>(pair.width) * pair.height;
    const size_t image = pixels * pair.channels;
    images.resize(2 * image);
    if (!input.read_all(images.data(), images.size())) {
      std::fputs("svl's input ended within an image\n", stderr);
      return 1;
    }
    pair.left = images.data(), pair.right = pair.left + image;
    disparities.resize(pixels);
    answer.disparity = disparities.data();
    if (is_first) {
      is_first = false;
      // svl sends the pair once more, in colour where that was asked for.
      const std::string said = hello_line(hello);
      if (!write_all(target, said.data(), said.size())) return 1;
      continue;
    }
    const std::string seq = std::to_string(static_cast<unsigned long long>(number(line, "seq")));
    std::string reply;
    bool is_matched = true;
    try {
      const auto match = [&] {
        std::fill_n(answer.disparity, pixels, none);
        answer.cells.clear();
        const auto began = Clock::now();
        function(static_cast<const Pair&>(pair), answer);
        return std::chrono::duration<double, std::milli>(Clock::now() - began).count();
      };
      if (pair.width != warm_width || pair.height != warm_height) {
        match();
        warm_width = pair.width, warm_height = pair.height;
      }
      reply = reply_line(seq, match(), answer.cells);
    } catch (const std::exception& error) {
      is_matched = false;
      reply = "{\"seq\":" + seq + ",\"error\":" + quoted(error.what()) + "}\n";
    }
    if (is_matched)
      std::replace_if(
          answer.disparity, answer.disparity + pixels, [](float d) { return !std::isfinite(d); }, none);
    if (!write_all(target, reply.data(), reply.size())) return 1;
    if (is_matched && !write_all(target, answer.disparity, 4 * pixels)) return 1;
  }
  return 0;
}

}  // namespace svl

#endif
