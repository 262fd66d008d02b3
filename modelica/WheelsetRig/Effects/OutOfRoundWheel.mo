within WheelsetRig.Effects;
model OutOfRoundWheel "A wheel that is out of round"
  extends Quantities.PartialWheelRadius;
  parameter Units.Length cosine(min=-1e-3, max=1e-3) = 0.0 "Amplitude, part of cos";
  parameter Units.Length sine(min=-1e-3, max=1e-3) = 0.0 "Amplitude, part of sin";
  parameter Real order(unit="1", min=1.0, max=20.0) = 1.0 "Periods per turn";
  Units.Angle phi(start=0.0, fixed=true, nominal=100.0) "Angle of the wheel";
equation
  y = u + cosine*cos(order*phi) + sine*sin(order*phi);
  der(phi) = omega;
  annotation (
    __Workbench(effect(
      size={"cosine", "sine"}, matters=1e-5,
      separation="order tracking in a slow run-down, with and without brake")),
    Documentation(info="<html>
<p><code>y = u + cosine*cos(n*phi) + sine*sin(n*phi)</code>, order 1: 0.05 to 0.5 mm, 2
to 20: 5 to 30 um. The wheelset must follow the radius, so the creep force ripples with
<code>v^2</code>, also without brake.</p>
<h4>Limits</h4>
<p>One order. The wheel load does not ripple.</p>
</html>"));
end OutOfRoundWheel;
