/* The lower 64 bits of a product; `high` becomes the others. */
static inline uint64_t ${name}_product(uint64_t a, uint64_t b, uint64_t *high)
{
    uint64_t low = (a & 0xFFFFFFFF) * (b & 0xFFFFFFFF);
    uint64_t left = (a >> 32) * (b & 0xFFFFFFFF) + (low >> 32);
    uint64_t right = (a & 0xFFFFFFFF) * (b >> 32) + (left & 0xFFFFFFFF);

    *high = (a >> 32) * (b >> 32) + (left >> 32) + (right >> 32);
    return right << 32 | (low & 0xFFFFFFFF);
}

/* The square root of high * 2^64 + low, rounded down; it is below 2^40. */
static inline int64_t ${name}_root(uint64_t high, uint64_t low)
{
    uint64_t root = 0;

    for (int bit = 39; bit >= 0; bit--) {
        uint64_t tried = root | (uint64_t)1 << bit;
        uint64_t above;
        uint64_t square = ${name}_product(tried, tried, &above);
        if (above < high || (above == high && square <= low)) {
            root = tried;
        }
    }
    return (int64_t)root;
}
