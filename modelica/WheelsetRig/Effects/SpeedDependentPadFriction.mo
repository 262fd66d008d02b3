within WheelsetRig.Effects;
model SpeedDependentPadFriction "Pad friction that falls with sliding speed"
  extends Brakes.PartialPadFriction;
  parameter Real slope(unit="1", min=-0.5, max=0.5) = 0.0 "Relative fall from standstill to vRef";
  parameter Units.Velocity vRef(min=1.0, max=30.0) = 22.0*0.30/0.46
    "Sliding velocity at which the friction is nominal";
equation
  mu = level*(1.0 + slope*(1.0 - abs(v)/vRef));
  annotation (
    __Workbench(effect(
      size="slope", matters=0.01,
      separation="drag braking at constant roller speed, with a staircase of pressure up and down")),
    Documentation(info="<html>
<p><code>mu = level*(1 + slope*(1 - |v|/vRef))</code>. Organic pads rub harder at low speed: slope
0.1 to 0.4; sintered pads -0.1 to 0.15. The default of <code>vRef</code> is that of 22 m/s at the
wheel's circumference, radii 0.30 m and 0.46 m.</p>
<h4>Limits</h4>
<p>The first term of the measured curves: no Stribeck peak close to standstill.</p>
<h4>References</h4>
<p>W. Sawczuk et al. (2021), <em>Materials</em> 14(16), 4766: regression of measured friction of
railway discs on speed and force.</p>
</html>"));
end SpeedDependentPadFriction;
