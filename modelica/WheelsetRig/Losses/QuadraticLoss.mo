within WheelsetRig.Losses;
model QuadraticLoss "Coulomb, viscous and aerodynamic loss"
  extends PartialLoss;
  parameter Units.Torque c0(min=0) "Coulomb friction of bearings and seals";
  parameter Real c1(unit="N.m.s/rad", min=0) "Viscous friction";
  parameter Real c2(unit="N.m.s2/rad2", min=0) "Windage";
  parameter Units.AngularVelocity omega0(min=1e-6) = 0.05 "Speed below which the sign is smoothed";
equation
  tau = (c0 + c1*abs(omega) + c2*omega^2)*tanh(omega/omega0);
  annotation (Documentation(info="<html>
<h4>Limitations</h4>
<p>No stiction: below <code>omega0</code> the shaft creeps.</p>
</html>"));
end QuadraticLoss;
