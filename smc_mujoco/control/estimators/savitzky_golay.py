"""Savitzky-Golay, causal: derivatives, at the last of `window` readings, of their least-squares
polynomial of `degree`.

    velocity = sum_i c_i x_i,  c_i = sum_m p_m(t_i) p_m'(t_N) / |p_m|^2,  m = 0 .. degree
    acceleration with p_m''

p_m are the polynomials orthogonal on the window's N samples (Gram's): p_(m+1) = t p_m - b_m
p_(m-1), |p_m|^2 = N b_1 .. b_m, b_m = m^2 (N^2 - m^2) / (4 (4 m^2 - 1)). Polynomials of this degree
are exact once they fill the window. On smooth signals the error of the velocity is O(h^degree).
White noise of x passes with the gain |c|, for degree 2 sqrt(12 (2N-1) (8N-11) / (N (N^2-1)
(N^2-4))) / h. Until the window is full, the first reading fills it. Window and degree are rounded
down, and limited to 2 .. 128 and 1 .. window - 1.
Gains: window, number of readings; degree, of the polynomial.
Sources: A. Savitzky & M. Golay, "Smoothing and differentiation of data by simplified least squares
procedures", Anal. Chem. 36(8):1627, 1964; P. Gorry, "General least-squares smoothing and
differentiation by the convolution (Savitzky-Golay) method", Anal. Chem. 62(6):570, 1990 (Gram
polynomials, end points).
"""

from smc_mujoco.control.estimator import estimator_function
from smc_mujoco.control.units import Gain

MAX_READINGS = 128  # readings in memory
WHOLE = f"whole window and degree, and 1 <= degree < window <= {MAX_READINGS}"
CONDITIONS = {
    f"{WHOLE}, else rounded down and limited": lambda g: (
        g.window == int(g.window)
        and g.degree == int(g.degree)
        and 1 <= g.degree < g.window <= MAX_READINGS
    )
}


@estimator_function(
    gains={
        "window": Gain(31.0, positive=True, held=True),
        "degree": Gain(2.0, positive=True, held=True),
    },
    memory=2 + 3 * MAX_READINGS,
    conditions=CONDITIONS,
)
def savitzky_golay(y, gains, memory):
    N = min(max(int(gains.window), 2), MAX_READINGS)
    degree = min(max(int(gains.degree), 1), N - 1)
    velocities = 2
    accelerations = 2 + MAX_READINGS
    readings = 2 + 2 * MAX_READINGS
    if memory[0] == 0.0:
        memory[0] = 1.0
        end = (N - 1) / 2.0
        for i in range(N):
            memory[readings + i] = y.x
            t = i - end
            norm = float(N)
            b = 0.0
            # p at t; q, q', q'' at the end; with _ those of degree m - 1
            p = 1.0
            p_ = 0.0
            q = 1.0
            q_ = 0.0
            dq = 0.0
            dq_ = 0.0
            ddq = 0.0
            ddq_ = 0.0
            for m in range(1, degree + 1):
                p, p_ = t * p - b * p_, p
                ddq, ddq_ = end * ddq + 2.0 * dq - b * ddq_, ddq
                dq, dq_ = end * dq + q - b * dq_, dq
                q, q_ = end * q - b * q_, q
                b = m * m * (N * N - m * m) / (4.0 * (4.0 * m * m - 1.0))
                norm *= b
                memory[velocities + i] += p * dq / norm
                memory[accelerations + i] += p * ddq / norm
    newest = int(memory[1])
    memory[readings + newest] = y.x
    memory[1] = (newest + 1) % N
    v = 0.0
    a = 0.0
    for i in range(N):
        # less rounding: a constant has no derivative
        x = memory[readings + (newest + 1 + i) % N] - y.x
        v += memory[velocities + i] * x
        a += memory[accelerations + i] * x
    return v / y.dt, a / y.dt**2
