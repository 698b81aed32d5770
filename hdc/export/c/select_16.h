/* How many pixels have each high byte. */
static inline void ${name}_count(${name}_scratch *s, const ${name}_pixel *pixels)
{
    for (int v = 0; v < 256; v++) {
        s->counts[v] = 0;
    }
    for (uint32_t j = 0; j < ${NAME}_RANKED; j++) {
        s->counts[pixels[j] >> 8]++;
    }
}

/* The threshold that `ones` pixels are at or above, and which at it become ones. */
static inline ${name}_level ${name}_threshold(
    ${name}_scratch *s, const ${name}_pixel *pixels, uint32_t ones)
{
    ${name}_level level;
    uint32_t above = 0;
    uint32_t high = ${name}_descend(s->counts, ones, &above);
    uint32_t low;

    for (int v = 0; v < 256; v++) {
        s->low_counts[v] = 0;
    }
    for (uint32_t j = 0; j < ${NAME}_RANKED; j++) {
        if ((uint32_t)pixels[j] >> 8 == high) {
            s->low_counts[pixels[j] & 255]++;
        }
    }
    low = ${name}_descend(s->low_counts, ones, &above);
    level.value = high << 8 | low;
    ${name}_split(s, pixels, &level, ones - above, s->low_counts[low]);
    return level;
}
