
/* NumPy's PCG64 (O'Neill, 2014): 128 bits and what is added to them, by 32-bit limbs, the lowest first. */
static void add_limbs(unsigned int *a, const unsigned int *b)
{
    uint64_t carried = 0U;

    for (int i = 0; i < 4; ++i) {
        carried += (uint64_t)a[i] + (uint64_t)b[i];
        a[i] = (unsigned int)(carried & 0xffffffffU);
        carried >>= 32U;
    }
}

/* The next of its 128 bits: times a constant, and what is added. */
static void turn_generator(struct controller *state)
{
    static const unsigned int factor[4] = {0x9fccf645U, 0x4385df64U, 0x1fc65da4U, 0x2360ed05U};
    unsigned int product[4] = {0U, 0U, 0U, 0U};

    for (int i = 0; i < 4; ++i) {
        uint64_t carried = 0U;

        for (int j = 0; (j < 4) && ((i + j) < 4); ++j) {
            carried += ((uint64_t)state->plan_draws[i] * (uint64_t)factor[j]) + (uint64_t)product[i + j];
            product[i + j] = (unsigned int)(carried & 0xffffffffU);
            carried >>= 32U;
        }
    }
    for (int i = 0; i < 4; ++i) {
        state->plan_draws[i] = product[i];
    }
    add_limbs(state->plan_draws, &state->plan_draws[4]);
}

/* Draws numbers from 0 to 1, of 53 bits. */
static void draw_numbers(struct controller *state, int count)
{
    for (int i = 0; (i < DRAWN) && (i < count); ++i) {
        uint64_t high = 0U;
        uint64_t mixed = 0U;
        unsigned int turn = 0U;

        turn_generator(state);
        high = ((uint64_t)state->plan_draws[3] << 32U) | (uint64_t)state->plan_draws[2];
        mixed = high ^ (((uint64_t)state->plan_draws[1] << 32U) | (uint64_t)state->plan_draws[0]);
        turn = (unsigned int)(high >> 58U);
        mixed = (mixed >> turn) | (mixed << ((64U - turn) & 63U));
        state->drawn[i] = (double)(mixed >> 11U) * (1.0 / 9007199254740992.0);
    }
}

/* NumPy's SeedSequence: a word, with a constant that changes from word to word. */
static unsigned int hashed(unsigned int word, unsigned int *constant, unsigned int factor)
{
    unsigned int value = word ^ *constant;

    *constant *= factor;
    value *= *constant;
    return value ^ (value >> 16U);
}

/* Two words of its pool. */
static unsigned int mixed_words(unsigned int a, unsigned int b)
{
    const unsigned int value = (0xca01f9ddU * a) - (0x4973f715U * b);

    return value ^ (value >> 16U);
}

/* Seeds the generator by position and velocity, and what is searched for: a period, 0, and a search's number. */
static void seed_draws(struct controller *state, int period, int search)
{
    unsigned int words[15] = {0U};
    unsigned int pool[4] = {0U};
    unsigned int seeds[8] = {0U};
    unsigned int constant = 0x43b0d7e5U;

    for (int i = 0; i < 6; ++i) {
        uint64_t bits = 0U;

        (void)memcpy(&bits, &state->plan_state[i], sizeof(bits));
        words[2 * i] = (unsigned int)(bits & 0xffffffffU);
        words[(2 * i) + 1] = (unsigned int)(bits >> 32U);
    }
    words[12] = (unsigned int)period;
    words[14] = (unsigned int)search;
    for (int i = 0; i < 4; ++i) {
        pool[i] = hashed(words[i], &constant, 0x931e8875U);
    }
    for (int from = 0; from < 4; ++from) {
        for (int to = 0; to < 4; ++to) {
            if (from != to) {
                pool[to] = mixed_words(pool[to], hashed(pool[from], &constant, 0x931e8875U));
            }
        }
    }
    for (int from = 4; from < 15; ++from) {
        for (int to = 0; to < 4; ++to) {
            pool[to] = mixed_words(pool[to], hashed(words[from], &constant, 0x931e8875U));
        }
    }
    constant = 0x8b51f9ddU;
    for (int i = 0; i < 8; ++i) {
        seeds[i] = hashed(pool[i & 3], &constant, 0x58f38dedU);
    }
    /* words of 64 bits, each with its lower half first: the higher one of two stands first */
    for (int i = 0; i < 4; ++i) {
        const unsigned int low = seeds[4 + ((i + 2) & 3)];
        const unsigned int below = (i > 0) ? (seeds[4 + ((i + 1) & 3)] >> 31U) : 1U;

        state->plan_draws[4 + i] = (low << 1U) | below;
        state->plan_draws[i] = 0U;
    }
    turn_generator(state);
    for (int i = 0; i < 4; ++i) {
        pool[i] = seeds[(i + 2) & 3];
    }
    add_limbs(state->plan_draws, pool);
    turn_generator(state);
}
