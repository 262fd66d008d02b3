within WheelsetRig.Sensors;
model PoleRingEccentricity "An eccentric pole ring of the wheelset's speed sensor"
  extends PartialSpeedSensor;
  parameter Real cosine(unit="1", min=-0.01, max=0.01) = 0.0 "Relative amplitude, part of cos";
  parameter Real sine(unit="1", min=-0.01, max=0.01) = 0.0 "Relative amplitude, part of sin";
  parameter Real order(unit="1", min=1.0, max=12.0) = 1.0 "Periods per turn";
  Units.Angle phi(start=0.0, fixed=true, nominal=100.0) "Angle of the ring";
equation
  y = u*(1.0 + cosine*cos(order*phi) + sine*sin(order*phi));
  der(phi) = u;
  annotation (
    __Workbench(effect(
      size={"cosine", "sine"}, matters=5e-5, slots={"speedSensorW"},
      separation="order tracking in a slow run-down, with and without brake")),
    Documentation(info="<html>
<p><code>y = u*(1 + cosine*cos(n*phi) + sine*sin(n*phi))</code>. An eccentricity of 0.05
to 0.3 mm at a ring of 60 to 120 mm gives 0.05 to 0.3 %. The reading of one sensor ripples and
nothing else.</p>
</html>"));
end PoleRingEccentricity;
