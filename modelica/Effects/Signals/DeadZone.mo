within Effects.Signals;
model DeadZone "A range around zero that has no effect"
  extends Interfaces.Signal;
  parameter Real zone(min=0.0) = 0.0 "Half of the range, in the unit of the value";
  parameter Real width(min=1e-12) = 1e-3 "Over which the kinks are rounded, in the unit of the value";
equation
  y = Functions.above(u - zone, width) - Functions.above(-u - zone, width);
  annotation (Documentation(info="<html>
<p><code>y = max(0, u - zone) - max(0, -u - zone)</code>: what a drive needs before it moves, in either
direction. The kinks are rounded, see <code>Functions.above</code>; at zero this is <code>u</code>
exactly.</p>
</html>"));
end DeadZone;
