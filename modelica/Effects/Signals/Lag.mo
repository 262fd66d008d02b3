within Effects.Signals;
model Lag "What lags behind, at first order"
  extends Interfaces.Signal;
  parameter Real lag(unit="s", min=0.0) = 0.0 "Time constant";
  parameter Real window(unit="s", min=1e-6) = 0.01 "Least time over which the rate is taken";
  Real past(start=0.0, fixed=true) "u, smoothed";
protected
  Real T(unit="s") "Time constant of the smoothing";
equation
  T = sqrt(lag^2 + window^2);
  T*der(past) = u - past;
  y = u - lag*der(past);
  annotation (Documentation(info="<html>
<p><code>y = u - lag*der(past)</code>, <code>T*der(past) = u - past</code>, <code>T^2 = lag^2 +
window^2</code>: a lag of first order where <code>lag</code> is well above <code>window</code>,
exactly nothing at zero. On a ramp <code>y</code> is late by <code>lag</code> at any size; on a step
the share <code>1 - lag/T</code> arrives at once.</p>
<h4>Limits</h4>
<p>No dead time. <code>u</code> is 0 before the start; a modifier <code>past(start=...)</code> says
otherwise.</p>
</html>"));
end Lag;
