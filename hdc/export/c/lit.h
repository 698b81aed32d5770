/* The pixels that were lit in training, one after the other: no others are ranked. */
static inline const ${name}_pixel *${name}_lit_pixels(
    ${name}_scratch *s, const ${name}_pixel *frame)
{
    uint32_t n = 0;

    for (uint32_t j = 0; j < ${NAME}_PIXELS; j++) {
        if (${name}_lit[j / 64] >> (j % 64) & 1) {
            s->lit[n] = frame[j];
            n++;
        }
    }
    return s->lit;
}
