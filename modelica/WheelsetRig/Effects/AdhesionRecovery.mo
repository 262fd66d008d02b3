within WheelsetRig.Effects;
model AdhesionRecovery "A rail that slip cleans"
  extends Contact.PartialAdhesion;
  parameter Real gain(unit="1", min=-0.5, max=3.0) = 0.0 "Relative change when clean";
  parameter Units.Energy Er(min=50e3, max=1e6) = 250e3 "Energy of slip that leaves 1/e of the dirt";
  Real kappa(unit="1", start=0.0, fixed=true) "Share that is clean";
equation
  mu0 = level*(1.0 + gain*kappa);
  der(kappa) = (1.0 - kappa)*abs(Fx*w)/Er;
  annotation (
    __Workbench(effect(
      size="gain", matters=0.05,
      shapes(Er={0.1e6, 0.25e6, 0.5e6}),
      separation="a slip sweep by the drive at constant speed, up and down")),
    Documentation(info="<html>
<p><code>mu0 = level*(1 + gain*kappa)</code>, <code>der(kappa) = (1 - kappa)*|Fx*w|/Er</code>: the
energy of slip of one wheel cleans the contact, so a second slide bears more. Er is 50 to 500
kJ.</p>
<h4>Limits</h4>
<p>Nothing soils the contact again.</p>
<h4>References</h4>
<p>P. Voltr, M. Lata (2015), <em>Vehicle System Dynamics</em> 53; B. Allotta, E. Meli et al. (2014),
<em>Tribology International</em>.</p>
</html>"));
end AdhesionRecovery;
