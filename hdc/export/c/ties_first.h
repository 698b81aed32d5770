/* $rule */
static inline void ${name}_split(
    ${name}_scratch *s, const ${name}_pixel *pixels, ${name}_level *level,
    uint32_t missing, uint32_t equal)
{
    (void)s;
    (void)pixels;
    (void)equal;
    level->room = ${room};
}

/* Whether pixel j becomes a one; asked for one pixel after the other. */
static inline int ${name}_is_one(${name}_level *level, uint32_t pixel, uint32_t j)
{
    (void)j;
    if (pixel == level->value && level->room > 0) {
        level->room--;
        return 1;
    }
    return pixel > level->value;
}
