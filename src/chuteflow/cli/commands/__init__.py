"""The commands: a new one is one module here with a ``command``, and one row in the table."""

#: Names and short descriptions, so that the list of commands is printed without importing any.
COMMANDS = {
    "solve": "The steady flows of a chute at a flux, hold-up, centre of mass or temperature.",
    "curve": "The branches of flows of a chute, with folds and other special points.",
    "boundary": "Folds, onsets of density inversion and changes of interior through a second parameter.",
    "domain": "Where flows exist, how many and of which kind, over two parameters.",
    "hot": "The hot, dilute flow of a chute: scaling laws, existence and its range of slopes.",
    "sweep": "The flows of very many chutes, described by a study file, in a Zarr store.",
    "sensitivities": "Exact derivatives of every quantity of a flow with respect to each parameter of its chute.",
    "fit": "The parameters of a chute from measurements, with their uncertainties.",
    "predict": "Flows of a fitted chute with bands, also at another slope.",
    "design": "The chutes that have a flow with given numbers, such as a flux of 3 at a hold-up of 1.",
    "cases": "The chutes and materials that --case takes, and how each number is known.",
    "closures": "The constitutive laws, their parameters, and the functions of one of them.",
    "compare-closures": "The flows of one chute under several constitutive laws, compared.",
    "figures": "Draw figures of the paper.",
    "claims": "Compute every statement of the paper that can be tested, with a verdict on each.",
    "report": "One page with every figure and claim of the paper, recomputed, and verdicts.",
    "explore": "An interactive page in the browser: vary every parameter, and see the flows.",
    "stability": "Which flows are stable, and the disturbance that grows fastest.",
    "growth": "Growth rates of a flow over wavenumbers along and across the slope, and its neutral curves.",
    "neutral": "Growth of waves in one direction along a branch of flows, and the neutral curves.",
    "dem": "Simulate the grains of a chute one by one with LAMMPS, and measure the flow.",
    "compare": "Compare a simulated or measured flow with the flows and laws of the theory.",
    "relax": "Follow a disturbed flow in time, to the steady flow that it comes to.",
}
