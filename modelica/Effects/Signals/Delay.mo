within Effects.Signals;
model Delay "A reading that is late"
  extends Interfaces.Signal;
  parameter Real delay(unit="s") = 0.0 "Time by which it is late";
  parameter Real window(unit="s", min=1e-6) = 0.01 "Least time over which the rate is taken";
  Real change(start=0.0, fixed=true) "Of u, within T";
protected
  Real T(unit="s") "Time over which the rate is taken";
equation
  T = sqrt(delay^2 + window^2);
  der(change) = der(u) - change/T;
  y = u - delay/T*change;
  annotation (Documentation(info="<html>
<p>First order of a delay, <code>u - delay*der(u)</code>, with the rate taken over the time
<code>T</code>: <code>T^2 = delay^2 + window^2</code>. What reads early has a negative delay. The
reading depends on states alone, so that an observer's correction of <code>der(u)</code> does not act
on it at once.</p>
<h4>Limits</h4>
<p>Changes within <code>T</code> are read in part. <code>u</code> is steady before the start, and
follows from states: an input of the model has no derivative, and takes <code>Lag</code>.</p>
</html>"));
end Delay;
