/* svl for C and C++: distances of a grid of cells from a stereo pair.
 *
 * Install:  src/c/install.sh /usr/local
 * Link:     cc robot.c $(pkg-config --cflags --libs svl) -o robot; or by CMake: find_package(svl), svl::svl, svl::static
 *
 * A handle is for one thread at a time; several handles are independent, and none works in a child of fork(). Pointers that
 * a handle returns are valid until its next svl_match or svl_close. After the first pairs of a size svl_match allocates no
 * memory. Equal runs of pairs give equal bytes on every CPU, instruction set and number of threads.
 */
#ifndef SVL_H
#define SVL_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Result of a call. svl_error() has the text. */
typedef enum svl_status {
    SVL_OK = 0,
    SVL_INVALID = 1,   /* an argument: a null pointer, a size, a rig, an unknown algorithm or parameter */
    SVL_FILE = 2,      /* a file cannot be read, or is not what it should be */
    SVL_NO_RESULT = 3, /* no pair was matched yet */
    SVL_INTERNAL = 4,  /* a bug in svl; the handle can only be closed */
    SVL_MEMORY = 5     /* no memory for images of that size; the handle can be used */
} svl_status;

/* State of a cell. */
typedef enum svl_state {
    SVL_UNKNOWN = 0,
    SVL_KNOWN = 1,     /* at infinity, too */
    SVL_TOO_CLOSE = 2, /* nearer than the range of disparities (filter too-close) */
    SVL_NEAR = 3       /* something is nearer than 0.5 m, and the cell has no distance */
} svl_state;

/* Reason of an invalid pixel, and of an unknown cell. */
typedef enum svl_reason {
    SVL_VALID = 0,        /* a known cell, or a pixel with a disparity */
    SVL_BORDER = 1,       /* the window or all disparities leave the image */
    SVL_UNTEXTURED = 2,   /* too little texture */
    SVL_AMBIGUOUS = 3,    /* another disparity costs nearly as little */
    SVL_INCONSISTENT = 4, /* the right image prefers another match: often occluded */
    SVL_SELF_CHECK = 5,   /* the window resembles its own surroundings */
    SVL_UNMATCHED = 6,    /* no window of the right image matches it best */
    SVL_FLOOR = 7,        /* the filter floor dropped it */
    SVL_DISAGREEMENT = 8  /* of a cell: enough pixels are valid, but they do not agree well enough */
} svl_reason;

/* A cell of the grid. */
typedef struct svl_cell {
    float distance_m;     /* along the optical axis; INFINITY at infinity; NAN if unknown or without a rig */
    float disparity_px;   /* NAN if unknown */
    float probability;    /* that the distance is right, or of SVL_NEAR that something is near, 0 to 1; NAN without one */
    float valid_fraction; /* of the cell's pixels, 0 to 1 */
    uint8_t state;        /* svl_state */
    uint8_t reason;       /* svl_reason */
    uint8_t level;        /* size of the image that decided: 0 the pair's, 1 half of it, ...; 0 but for v5 */
    uint8_t reserved;
    /* The nearer of two surfaces, or what is seen in an unknown cell; NAN without one. Of v5's small cells (24 x 12). */
    float near_distance_m;
    float near_px;
    float surface_probability; /* that the cell has a surface there, 0 to 1 */
} svl_cell;

/* Layout of a pixel. 16-bit values are in the machine's byte order; svl matches the upper eight of the bits in use, and larger
 * values are white. Colours become grey, and the fourth byte is ignored. */
typedef enum svl_format {
    SVL_GRAY8 = 0,
    SVL_GRAY10 = 1, /* 16-bit values up to 1023 */
    SVL_GRAY12 = 2,
    SVL_GRAY14 = 3,
    SVL_GRAY16 = 4,
    SVL_RGB8 = 5,
    SVL_BGR8 = 6,
    SVL_RGBA8 = 7,
    SVL_BGRA8 = 8
} svl_format;

/* An image in the caller's memory, which svl reads only during svl_match. */
typedef struct svl_image {
    const void *pixels;
    uint32_t width, height;
    size_t stride;   /* bytes from a row to the next; 0: no gaps */
    uint32_t format; /* svl_format */
} svl_image;

/* Begin with `svl_options options = SVL_OPTIONS;`. Everything else 0 or NULL is the default: v5, rectified images without a
 * rig, 5 x 3 cells, a thread per core. */
typedef struct svl_options {
    size_t size;            /* sizeof(svl_options) */
    const char *algorithm;  /* as on svl's command line: "v3:max_disparity=64" */
    /* Raw images: the file of a calibration (OpenCV, ROS, Kalibr, ...), or its text: one, or those of the left and the right
     * camera. */
    const char *calibration;
    const char *const *calibration_texts;
    size_t calibration_text_count;
    const char *const *filters; /* filter_count files of `svl train filter` */
    size_t filter_count;
    /* The rig of rectified images; not with a calibration. focal_px 0: none, so cells have no distances. */
    double focal_px;
    double baseline_m;
    double cx_px, cy_px;
    double doffs_px; /* cx of the right image minus cx of the left one */
    uint32_t columns, rows;
    uint32_t threads; /* at most 1024 */
} svl_options;

#define SVL_OPTIONS {sizeof(svl_options), NULL, NULL, NULL, 0, NULL, 0, 0, 0, 0, 0, 0, 0, 0, 0}

typedef struct svl_handle svl_handle;

/* Opens a matcher; *handle is NULL unless the result is SVL_OK. options may be NULL. */
svl_status svl_open(const svl_options *options, svl_handle **handle);

/* Matches a pair. stamp_ns: time of the exposure by any clock; 0: none. v5 uses the cells of earlier pairs of the same size,
 * unless more than a second lies between two, or the clock does not rise; without stamps, of all pairs since svl_open or
 * svl_reset. */
svl_status svl_match(svl_handle *handle, const svl_image *left, const svl_image *right, uint64_t stamp_ns);

/* Forgets the earlier pairs: the next one is the first of another scene. */
svl_status svl_reset(svl_handle *handle);

/* Cells of the last pair, row by row from the top left. columns and rows may be NULL. */
svl_status svl_cells(svl_handle *handle, const svl_cell **cells, uint32_t *columns, uint32_t *rows);

/* Disparities in pixels (INFINITY if invalid) and svl_reason of each pixel, row by row without gaps. width and height are
 * those of the rectified images. Every pointer but handle may be NULL. */
svl_status svl_disparities(svl_handle *handle, const float **disparities, const uint8_t **reasons, uint32_t *width,
                           uint32_t *height);

void svl_close(svl_handle *handle); /* NULL is allowed */

/* Text of the last error of this thread, one line of UTF-8, valid until the thread's next call; "" if there was none. */
const char *svl_error(void);
/* Name of a reason, as in svl's tables; "" for another number. */
const char *svl_reason_name(uint8_t reason);
/* Version of svl, and the instruction set in use: avx512, avx2, portable or neon. */
const char *svl_version(void);
const char *svl_instruction_set(void);

#ifdef __cplusplus
}
#endif

#endif
