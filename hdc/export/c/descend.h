/* The largest value that at least `ones` pixels reach; `above` grows by those above. */
static inline uint32_t ${name}_descend(
    const uint32_t *counts, uint32_t ones, uint32_t *above)
{
    uint32_t value = 255;

    while (value > 0 && *above + counts[value] < ones) {
        *above += counts[value];
        value--;
    }
    return value;
}
