within Effects.Friction;
model Viscous "Viscous friction"
  extends Interfaces.Friction;
  parameter Real damping(unit="N.s/m", min=0.0) = 0.0 "Friction per velocity";
equation
  f = damping*v;
  annotation (Documentation(info="<html>
<p><code>f = damping*v</code>: a full film of lubricant, after O. Reynolds (1866); also eddy
currents.</p>
</html>"));
end Viscous;
