"""From measurements to parameters: calibration with uncertainties, comparison of laws, prediction with bands."""
