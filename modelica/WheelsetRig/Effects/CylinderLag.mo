within WheelsetRig.Effects;
model CylinderLag "Pads that lag behind the measured pressure"
  extends Brakes.PartialCylinder;
  parameter Real lag(unit="s", min=0.0, max=0.2) = 0.0 "Time constant";
  parameter Real window(unit="s", min=1e-3) = 0.01 "Least time over which the rate is taken";
  Units.Pressure past(start=0.0, fixed=true, nominal=1e5) "Pressure, smoothed";
protected
  Real T(unit="s") "Time constant of the smoothing";
equation
  T = sqrt(lag^2 + window^2);
  T*der(past) = pB - past;
  p = pB - lag*der(past);
  rest = restBefore;
  annotation (
    __Workbench(effect(
      size="lag", step=0.005, matters=0.003,
      separation="a sine on the pressure at constant speed")),
    Documentation(info="<html>
<p><code>p = pB - lag*der(past)</code>, <code>T*der(past) = pB - past</code>, <code>T^2 = lag^2 +
window^2</code>: a lag of first order where <code>lag</code> is well above <code>window</code>,
exactly nothing at zero. On a ramp the pads are late by <code>lag</code> at any size; on a step the
share <code>1 - lag/T</code> arrives at once. 10 to 100 ms between sensor and cylinder are
usual.</p>
<h4>Limits</h4>
<p>No dead time. The cylinder is empty at the start.</p>
</html>"));
end CylinderLag;
