"""What each figure shows, in a few words of our own: for pages that put words beside the pictures."""

from __future__ import annotations

#: By number, as plain text.
CAPTIONS = {
    1: "The chute at the angle θ, x down the slope and z normal to it, with gravity g. Grains are strewn by the "
    "volume fraction of flow C of figure 2, and the arrows are its velocity: a sketch, not a simulation.",
    2: "The three flows that share the mass flux Q = 3 on the slope tan θ = 0.3: volume fraction, granular "
    "temperature and velocity against height. Solid: high temperature, dilute (A). Dotted: mid-temperature (B). "
    "Dashed: low temperature, dense (C). Grains and base have e = e_w = 0.8, r = 0.6, here and below unless other "
    "values are given.",
    3: "The branch of flows on the slope 0.3: centre of mass and hold-up against mass flux, and centre of mass "
    "against hold-up. The points are the flows of figure 2. Flux folds back twice; hold-up does not.",
    4: "Centre of mass against mass flux for slopes from 0.22 to 0.30 (a) and from 0.30 to 0.36 (b). Solid where the "
    "density is inverted, dashed where it falls with height. Gentle slopes have three flows in a range of flux, "
    "steep ones two above a least flux. A second, very cold branch on the slope 0.34 is not in the paper.",
    5: "A productive flow: e = 0.9, e_w = 0.6, r = 0.8, slope 0.4, Q = 3. The temperature rises from the base and "
    "has its maximum inside, by very little: the inset enlarges the difference from the value far above.",
    6: "Centre of mass against mass flux of productive flows (e = 0.9, e_w = 0.6, r = 0.8), slopes from 0.40 to "
    "0.44: one flow for each flux, all with a density that falls with height.",
    7: "Volume fraction of the three flows at Q = 3 on the slope 0.3, with the conditions of a half-line (solid) and "
    "of an interface to grains in free flight (dashed, ending at the interface with a point).",
    8: "Centre of mass against mass flux on the slope 0.3 with either surface: half-line solid, interface dashed.",
    9: "As figure 4, with interface conditions. Solid where the density is inverted, dashed where it falls with "
    "height. Unlike in the paper, there are inverted densities on the slope 0.29 here as well.",
    10: "Centre of mass against mass flux on logarithmic axes, slopes from 0.22 to 0.30: hot flows become parallel to "
    "the dashed line, h ~ Q².",
    11: "The parameters λ and δ of the reduced model of hot flows against the slope. Hot flows of a dissipative "
    "interior (δ > 0) need 0 < λ < 3; inverted densities begin at λ = 0.660. λ diverges where δ vanishes.",
    12: "A hot flow on the slope 0.3, T_surface = 50: the full equations (solid) and the expansion of the reduced "
    "model to λ² (dashed), with the misprint of (4.23) mended.",
    13: "A hot flow on the slope where λ = 1, T_surface = 100: the full equations (solid) and the exact solution of "
    "the reduced model (dashed). Both have an inverted density.",
    14: "Where flows exist, in the plane of slope and roughness: e = e_w = 0.8 (a), e = 0.9 and e_w = 0.6 (b). Rings "
    "mark flows of the full equations at four surface temperatures, the hotter the wider. Curves are bounds of "
    "hot flows: λ = 0 and the exact λ = 3 (solid), the printed λ = 2.284 (dashed), the onset of inversion λ = "
    "0.660 (dotted), and δ = 0 (dash-dotted).",
    15: "The three flows at Q = 3 on the slope 0.3, with the modified Fourier heat flux (solid) and with the "
    "conduction along density gradients left out, g₄ = 0 (dotted). Rows: high, mid- and low temperature.",
    16: "The two terms of the heat flux in the three flows at Q = 3: along gradients of temperature (solid) and of "
    "volume fraction (dashed), against height.",
    17: "Centre of mass against mass flux on the slope 0.3 with the modified Fourier heat flux (solid) and with g₄ = "
    "0 (dotted).",
}
