within WheelsetRig.Effects;
model DiscThicknessVariation "Discs of uneven thickness"
  extends Brakes.PartialPadFriction;
  parameter Real cosine(unit="1", min=-0.1, max=0.1) = 0.0 "Relative amplitude, part of cos";
  parameter Real sine(unit="1", min=-0.1, max=0.1) = 0.0 "Relative amplitude, part of sin";
  parameter Real order(unit="1", min=1.0, max=12.0) = 1.0 "Periods per turn";
  parameter Units.Length rB(min=0.1) = 0.30 "Radius at which the pads act";
  Units.Angle phi(start=0.0, fixed=true, nominal=100.0) "Angle of the disc";
equation
  mu = level*(1.0 + cosine*cos(order*phi) + sine*sin(order*phi));
  der(phi) = v/rB;
  annotation (
    __Workbench(effect(
      size={"cosine", "sine"}, matters=0.001,
      separation="order tracking in a slow run-down, with and without brake")),
    Documentation(info="<html>
<p><code>mu = level*(1 + cosine*cos(n*phi) + sine*sin(n*phi))</code>, <code>der(phi) = v/rB</code>.
Thickness modulates the force of the pads, hot spots (order 4 to 12) their friction: 0.5 to 5 %. The
torque's ripple follows pressure, not speed, and is absent without brake.</p>
<h4>Limits</h4>
<p>One order.</p>
</html>"));
end DiscThicknessVariation;
