within Effects.Signals;
model Saturation "A limit that the value cannot exceed"
  extends Interfaces.Signal;
  parameter Real share(unit="1", min=0.0, max=1.0) = 0.0 "Of what exceeds the limits, that is lost";
  parameter Real high = 1.0 "Upper limit, in the unit of the value";
  parameter Real low = -high "Lower limit, in the unit of the value";
  parameter Real width(min=1e-12) = 1e-3 "Over which the kinks are rounded, in the unit of the value";
equation
  y = u - share*(Functions.above(u - high, width) - Functions.above(low - u, width));
  annotation (Documentation(info="<html>
<p><code>y = u - share*(max(0, u - high) - max(0, low - u))</code>: at a share of 1 nothing passes the
limits, at 0 they are not there; between them, the slope beyond is less. For one limit alone the other
is set far away. The kinks are rounded, see <code>Functions.above</code>.</p>
<h4>Limits</h4>
<p>A limit that no recording reaches does not show.</p>
</html>"));
end Saturation;
