within WheelsetRig.Effects;
model ApexOffset "A wheelset that stands beside the apex of the roller"
  extends Sensors.PartialForceSensor;
  parameter Units.Length offset(min=-0.005, max=0.005) = 0.0 "Of the contact along x";
  parameter Units.Length rW(min=0.1) = 0.46 "Wheel radius";
  parameter Units.Length rR(min=0.1) = 0.70 "Roller radius";
equation
  y = u + 2.0*Q/(rW + rR)*offset;
  annotation (
    __Workbench(effect(
      size="offset", matters=1.5e-4, after="FxOffset",
      separation="a step of the vertical load by 10 %")),
    Documentation(info="<html>
<p><code>y = u + 2*Q*offset/(rW + rR)</code>: both wheels lean on a slope, 138 N per mm on
the load cells at 80 kN, at any speed and in either direction.</p>
<h4>Limits</h4>
<p>Small angles. At constant wheel load this is an offset of the load cells.</p>
</html>"));
end ApexOffset;
