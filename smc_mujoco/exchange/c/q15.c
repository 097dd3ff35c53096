enum { FULL = 32768, MOST = 32767 };

/* The gains that smc_law_gains names, as words: for firmware that calls smc_q15_s and smc_q15_u itself. */
enum { Q15_ON_E = @ON_E@, Q15_ON_DE = @ON_DE@, Q15_LAM = @LAM@ };

/* tanh over 0 .. 8 in 256 steps, Q15. */
static const int16_t TABLE[257] = {
@TABLE@
};

int16_t smc_q15_s(int16_t e, int16_t de, int16_t on_e, int16_t on_de);
int16_t smc_q15_u(int16_t s, int16_t lam);

/* a b / 2^bits to the nearest, ties away from 0: a product of 32 bits and a rounding shift of its magnitude. */
static int32_t product(int32_t a, int32_t b, int bits)
{
    int32_t n = a * b;
    n = ((n < 0 ? -n : n) + ((int32_t)1 << (bits - 1))) >> bits;
    return (a < 0) == (b < 0) ? n : -n;
}

/* The sliding variable in Q15 of 8, from e in Q15 of e_range and de in Q15 of de_range. */
int16_t smc_q15_s(int16_t e, int16_t de, int16_t on_e, int16_t on_de)
{
    int32_t s = product(on_e, e, 11) + product(on_de, de, 11);
    return (int16_t)(s > MOST ? MOST : s < -MOST ? -MOST : s);
}

/* u in Q15 of u_range: -lam tanh(s), between the words of the table on a line. */
int16_t smc_q15_u(int16_t s, int16_t lam)
{
    int32_t size = s < -MOST ? MOST : s < 0 ? -(int32_t)s : s, i = size >> 7; /* -2^15 is beyond the table */
    int32_t t = TABLE[i] + product(TABLE[i + 1] - TABLE[i], size & 127, 7);
    return (int16_t)-product(lam, s < 0 ? -t : t, 15);
}

/* From here on: what an analogue-digital converter and the plant's units do, in floating point. */

/* a in units of unit / 2^15, to the nearest, ties away from 0, saturated. */
static int16_t word(smc_real a, smc_real unit)
{
    int32_t n = fabs(a) < unit ? (int32_t)floor(fabs(a) / unit * FULL + 0.5) : MOST;
    n = n > MOST ? MOST : n;
    return (int16_t)(a < 0 ? -n : n);
}

int smc_law(const smc_measurement *y, const smc_real *gains, smc_real *memory, smc_real *out)
{
    int16_t on_e = word(gains[GAIN_k1] * gains[GAIN_e_range] / 8.0, 16.0);
    int16_t on_de = word(gains[GAIN_de_range] / 8.0, 16.0), lam = word(gains[GAIN_lam], gains[GAIN_u_range]);
    int16_t s = smc_q15_s(word(y->e, gains[GAIN_e_range]), word(y->de, gains[GAIN_de_range]), on_e, on_de);
    smc_real v = y->has_surface != 0 ? y->v_eq : -y->model * gains[GAIN_k1] * y->de; /* keeps s; 0 without the model */
    (void)memory;
    if (y->has_surface != 0) {
        s = word(y->s, 8.0);
    }
    v += smc_q15_u(s, lam) * gains[GAIN_u_range] / FULL;
    out[0] = y->model != 0 ? (v - y->f + y->ddr) / y->g : v;
    out[1] = s * 8.0 / FULL;
    return 0;
}
