"""The view of each type of result, by the type's name; :mod:`identify.views` imports it when it is first asked for."""

from identify.views import register

TABLES = "uq.report.tables"
VIEWS = {
    "identify.results.held_out_result.HeldOut": f"{TABLES}.held_out",
    "identify.joint.cramer_rao_bound.Bound": f"{TABLES}.measurands:bound",
    "identify.results.identification_result.Identification": f"{TABLES}.identification",
    "identify.rigid_body.inertial_parameters.InertialParameters": f"{TABLES}.measurands:parameters",
    "identify.static.centre_result.Centre": f"{TABLES}.centre",
    "uq.barreto2016.PaperResult": f"{TABLES}.paper",
    "uq.bodies.comparison.Comparison": f"{TABLES}.comparison",
    "uq.bodies.export.Exported": f"{TABLES}.measurands:exported",
    "uq.bodies.reference.Reference": f"{TABLES}.measurands:reference",
    "uq.campaign.campaign_result.MonteCarloResult": f"{TABLES}.campaign",
    "uq.campaign.statistics.Breakdown": f"{TABLES}.cases:breakdown",
    "uq.campaign.statistics.Statistics": f"{TABLES}.cases:case",
    "uq.motion_design.arm.arm_report.ArmDesignReport": f"{TABLES}.design:arm",
    "uq.motion_design.hexapod.design.Design": f"{TABLES}.design:design",
    "uq.motion_design.hexapod.design_report.DesignReport": f"{TABLES}.design:platform",
    "uq.motion_design.hexapod.motion_export.MotionExport": f"{TABLES}.design:export",
    "uq.planning.measurement_plan.MeasurementPlan": f"{TABLES}.planning",
    "uq.planning.pose_plan.PosePlan": f"{TABLES}.poses",
    "uq.planning.required_duration.Duration": f"{TABLES}.planning:duration",
    "uq.planning.sensor_worth.SensorWorth": f"{TABLES}.planning:worth",
    "uq.propagation.law_of_propagation.LinearLaw": f"{TABLES}.measurands:linear_law",
    "uq.propagation.law_result.LawResult": f"{TABLES}.law",
    "uq.propagation.law_result.LawStatistics": f"{TABLES}.cases:case",
    "uq.propagation.law_validation.LawValidation": f"{TABLES}.law_validation",
    "uq.propagation.propagation_of_distributions.Propagation": f"{TABLES}.measurands:propagation",
    "uq.recorded.still_noise.StillNoise": f"{TABLES}.measurands:noise",
    "uq.sensitivity.budget_shares.BudgetResult": f"{TABLES}.budget",
    "uq.sensitivity.budget_shares.SourceBudget": f"{TABLES}.budget:pair",
    "uq.sensitivity.sobol_shapley.Sensitivity": f"{TABLES}.measurands:sensitivity",
}

register(VIEWS)
