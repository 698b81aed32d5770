/* The frame's hypervector: a bit for each pixel and threshold. */
static inline void ${name}_encode(${name}_scratch *s, const ${name}_pixel *frame)
{
    const ${name}_pixel *pixels = ${pixels};
    uint64_t word = 0;
    uint32_t n = 0; /* bits so far */

    ${name}_count(s, pixels);
    for (uint32_t t = 0; t < ${NAME}_THRESHOLDS; t++) {
        ${name}_level level = ${name}_threshold(s, pixels, ${name}_ones[t]);
        for (uint32_t j = 0; j < ${NAME}_RANKED; j++) {
            if (${name}_is_one(&level, pixels[j], j)) {
                word |= (uint64_t)1 << (n % 64);
            }
            n++;
            if (n % 64 == 0 || n == ${NAME}_BITS) {
                s->hypervector[(n - 1) / 64] = word;
                word = 0;
            }
        }
    }
}
