within ElectronicOscillator;
model Oscillator "Mass, damper and linear spring"
  parameter Real m(unit="s2", min=1e-8) = 5e-6 "Mass";
  parameter Real d(unit="s", min=0.0) = 2e-4 "Damping";
  parameter Real k(unit="1", min=1e-3) = 1.0 "Stiffness";
  parameter Real u0(unit="V") = 0.0 "Reading of the input without a force";
  parameter Real y0(unit="V") = 0.0 "Reading of the output at rest";
  parameter Real b(unit="V") = 0.0 "Constant force that observers follow";

  input Real u(unit="V") "Force";
  input Real db(unit="V") "Correction of b";

  output Real y(unit="V", start=0.0, fixed=true, nominal=0.1) "Displacement";
  output Real v(unit="V/s", start=0.0, fixed=true, nominal=40.0) "Its rate";
  output Real reading(unit="V") = sensor.y + y0 "Of the displacement";

  replaceable Common.Signals.Unchanged source(u=u - u0)
    constrainedby Common.Interfaces.Signal(u=u - u0) "From the input to the force";
  replaceable Interfaces.NoForce spring(v=v, y=y)
    constrainedby Interfaces.PartialForce(v=v, y=y) "Beside the linear spring and damper";
  replaceable Common.Signals.Unchanged sensor(u=y)
    constrainedby Common.Interfaces.Signal(u=y) "From the displacement to its reading";
equation
  der(y) = v;
  m*der(v) = source.y + b + db - d*v - k*y - spring.f;
  annotation (
    experiment(StopTime=1.0, Tolerance=1e-8),
    Documentation(info="<html>
<p><code>m*y'' + d*y' + k*y = u</code>: some 68 Hz. Offsets of both cards belong to the individual
circuit.</p>
</html>"));
end Oscillator;
