"""Tension of an SMA spring: rate-independent hysteresis in elongation, between two branches that move with temperature.

    s_Sm = max(s_start, k (T - M_s)),  s_Fm = max(s_finish, k (T - M_f)),  e_Sm = s_Sm / E_A,  e_Fm = s_Fm / E_M + e_in
    s_Sa = k (T - A_s),                s_Fa = k (T - A_f),                 e_Fa = s_Fa / E_A,  e_Sa = s_Sa / E_M + e_in

    upper(e) = s_Fm + (s_Fm - s_Sm) / (e_Fm - e_Sm) (e - e_Fm)        to martensite, while pulled or cooled
    lower(e) = s_Fa + (s_Fa - s_Sa) / (e_Fa - e_Sa) (e - e_Fa)        to austenite, while released or heated
    Y = max(E_M (e - e_in), min(E_A e, upper, max(lower, s_prev + E_M (e - e_prev))))
    s = max(0, Y)

Inside the loop the slope is E_M, from the last state. Every piece of Y rises with e. At each moment the spring is therefore a taut
or slack tendon held at a length, with a compliance of 1/slope.

Source: Kolyvas and Tzes, J. Intell. Mater. Syst. Struct. 2018, doi 10.1177/1045389X18770880 (their code's operator).
"""

from twin.foundation.compiled import jit

LEAST_SLOPE_SHARE = 1e-3  # of E_M, the least slope of a plateau


@jit
def hysteresis_branches(spring, t, temperature):
    """Return force (N) at zero elongation and slope (N/m) of the upper branch, then of the lower.

    Spring t of the `Spring.records` at `temperature` (K).
    """
    k, e_in = spring[t].force_per_kelvin, spring[t].transformation_elongation
    EA, EM = spring[t].austenite_stiffness, spring[t].martensite_stiffness
    start = max(spring[t].detwinning_start, k * (temperature - spring[t].martensite_start))
    finish = max(spring[t].detwinning_finish, k * (temperature - spring[t].martensite_finish))
    slope_up = branch_slope(start, finish, finish / EM + e_in - start / EA, LEAST_SLOPE_SHARE * EM)
    upper = finish - slope_up * (finish / EM + e_in)
    begin = k * (temperature - spring[t].austenite_start)
    end = k * (temperature - spring[t].austenite_finish)
    slope_down = branch_slope(end, begin, begin / EM + e_in - end / EA, LEAST_SLOPE_SHARE * EM)
    return upper, slope_up, end - slope_down * end / EA, slope_down


@jit
def branch_slope(low, high, length, least):
    """Return (high - low) / length (N/m), or `least` where that is less or `length` is not positive."""
    return max(least, (high - low) / length) if length > 0.0 else least


@jit
def tension_piece(spring, t, temperature, elongation, last_elongation, last_tension):
    """Return Y (N) and its slope (N/m) at an elongation (m). A negative Y means a slack spring."""
    EA, EM = spring[t].austenite_stiffness, spring[t].martensite_stiffness
    upper, slope_up, lower, slope_down = hysteresis_branches(spring, t, temperature)
    Y, slope = EM * (elongation - last_elongation) + last_tension, EM
    if lower + slope_down * elongation > Y:
        Y, slope = lower + slope_down * elongation, slope_down
    if upper + slope_up * elongation < Y:
        Y, slope = upper + slope_up * elongation, slope_up
    if EA * elongation < Y:
        Y, slope = EA * elongation, EA
    if EM * (elongation - spring[t].transformation_elongation) > Y:
        Y, slope = EM * (elongation - spring[t].transformation_elongation), EM
    return Y, slope
