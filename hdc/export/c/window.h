
/* The pixels of training, out of an image with `stride` pixels from row to row. */
static inline void ${name}_window(
    const ${name}_pixel *image, uint32_t stride, ${name}_pixel *frame)
{
    for (uint32_t y = 0; y < ${NAME}_HEIGHT; y++) {
        for (uint32_t x = 0; x < ${NAME}_WIDTH; x++) {
            frame[y * ${NAME}_WIDTH + x] =
                image[($y0 + $step * y) * stride + $x0 + $step * x];
        }
    }
}
