/* Ones of a word: by an instruction where the compiler is told of one, else by adding
   neighbouring fields (Warren, Hacker's Delight, 5-1). */
static inline uint32_t ${name}_popcount(uint64_t word)
{
#if defined(__GNUC__) && (defined(__POPCNT__) || defined(__aarch64__))
    return (uint32_t)__builtin_popcountll(word);
#else
    word -= (word >> 1) & 0x5555555555555555;
    word = (word & 0x3333333333333333) + ((word >> 2) & 0x3333333333333333);
    word = (word + (word >> 4)) & 0x0F0F0F0F0F0F0F0F;
    return (uint32_t)((word * 0x0101010101010101) >> 56);
#endif
}
