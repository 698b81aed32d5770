/* How many pixels have each value. */
static inline void ${name}_count(${name}_scratch *s, const ${name}_pixel *pixels)
{
    for (int v = 0; v < 256; v++) {
        s->counts[v] = 0;
    }
    for (uint32_t j = 0; j < ${NAME}_RANKED; j++) {
        s->counts[pixels[j]]++;
    }
}

/* The threshold that `ones` pixels are at or above, and which at it become ones. */
static inline ${name}_level ${name}_threshold(
    ${name}_scratch *s, const ${name}_pixel *pixels, uint32_t ones)
{
    ${name}_level level;
    uint32_t above = 0;

    level.value = ${name}_descend(s->counts, ones, &above);
    ${name}_split(s, pixels, &level, ones - above, s->counts[level.value]);
    return level;
}
