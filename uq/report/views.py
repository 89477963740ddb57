"""The view of each type of result, by the type's name; :mod:`identify.display.views` imports one when first asked."""

from identify.display.views import register

TABLES = "uq.report.tables"
VIEWS = {
    "identify.results.held_out_result.HeldOut": f"{TABLES}.held_out",
    "identify.estimation.joint.cramer_rao_bound.Bound": f"{TABLES}.measurands:bound",
    "identify.results.identification_result.Identification": f"{TABLES}.identification",
    "identify.rigid_body.inertial_parameters.InertialParameters": f"{TABLES}.measurands:parameters",
    "identify.estimation.static_poses.centre_result.Centre": f"{TABLES}.centre",
    "uq.monte_carlo.barreto2016.PaperResult": f"{TABLES}.paper",
    "uq.bodies.calibration.calibration_result.Calibration": f"{TABLES}.calibration",
    "uq.bodies.comparison.Comparison": f"{TABLES}.comparison",
    "uq.bodies.export.Exported": f"{TABLES}.measurands:exported",
    "uq.bodies.reference.Reference": f"{TABLES}.measurands:reference",
    "uq.monte_carlo.campaign.campaign_result.MonteCarloResult": f"{TABLES}.campaign",
    "uq.monte_carlo.campaign.spread_ratio.SpreadComparison": f"{TABLES}.sweep:spread",
    "uq.monte_carlo.campaign.sweep.SweepResult": f"{TABLES}.sweep",
    "uq.monte_carlo.campaign.statistics.Breakdown": f"{TABLES}.cases:breakdown",
    "uq.monte_carlo.campaign.statistics.Statistics": f"{TABLES}.cases:case",
    "uq.plan.motion_design.arm.arm_report.ArmDesignReport": f"{TABLES}.design:arm",
    "uq.plan.motion_design.hexapod.design.Design": f"{TABLES}.design:design",
    "uq.plan.motion_design.hexapod.design_report.DesignReport": f"{TABLES}.design:platform",
    "uq.plan.motion_design.hexapod.motion_export.MotionExport": f"{TABLES}.design:export",
    "uq.plan.measurement.measurement_plan.MeasurementPlan": f"{TABLES}.planning",
    "uq.plan.measurement.pose_plan.PosePlan": f"{TABLES}.poses",
    "uq.plan.measurement.required_duration.Duration": f"{TABLES}.planning:duration",
    "uq.plan.measurement.sensor_worth.SensorWorth": f"{TABLES}.planning:worth",
    "uq.analysis.propagation.law_of_propagation.LinearLaw": f"{TABLES}.measurands:linear_law",
    "uq.analysis.propagation.law_result.LawResult": f"{TABLES}.law",
    "uq.analysis.propagation.law_result.LawStatistics": f"{TABLES}.cases:case",
    "uq.analysis.propagation.law_validation.LawValidation": f"{TABLES}.law_validation",
    "uq.analysis.propagation.propagation_of_distributions.Propagation": f"{TABLES}.measurands:propagation",
    "uq.runs.recorded.still_noise.StillNoise": f"{TABLES}.measurands:noise",
    "uq.analysis.sensitivity.budget_shares.BudgetResult": f"{TABLES}.budget",
    "uq.analysis.sensitivity.budget_shares.SourceBudget": f"{TABLES}.budget:pair",
    "uq.analysis.sensitivity.sobol_shapley.Sensitivity": f"{TABLES}.measurands:sensitivity",
}

register(VIEWS)
