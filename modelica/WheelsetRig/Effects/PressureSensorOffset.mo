within WheelsetRig.Effects;
model PressureSensorOffset "A pressure sensor whose zero is wrong"
  extends Brakes.PartialCylinder;
  parameter Units.Pressure offset(min=-0.2e5, max=0.2e5) = 0.0 "Reading minus true pressure";
equation
  p = pB - offset;
  rest = restBefore + offset;
  annotation (
    __Workbench(effect(
      size="offset", matters=500.0,
      separation="its reading on a vented cylinder")),
    Documentation(info="<html>
<p><code>p = pB - offset</code>; with an empty cylinder the sensor reads <code>offset</code>, which
tells it from a return spring.</p>
</html>"));
end PressureSensorOffset;
