within TrainRig.Parts;
model Rail "Rail between two axles, which the one before has cleaned by its slip"
  parameter Real length(unit="m", min=0.1) "Distance of the axles";
  parameter Real clean(unit="1", min=0.0, max=1.0) = 0.32 "Friction that cleaning leads to at most";
  parameter Real needed(unit="J/m", min=1.0) = 4000.0 "Slip work that cleans wholly";
  parameter Real muStart(unit="1", min=0.0, max=1.0) = 0.40 "Friction at the start";
  input Real v(unit="m/s") "Speed";
  input Real mu(unit="1") "Friction that the axle before finds";
  input Real work(unit="J/m") "Slip work of one of its wheels along the rail";
  Real left(unit="1") "Friction that it leaves behind";
  Real next(unit="1", start=muStart, fixed=true) "Friction that the next axle finds";
equation
  left = mu + noEvent(max(0.0, min(mu, clean - mu))*min(1.0, work/needed));
  length*der(next) = v*(left - next);
  annotation (Documentation(info="<html>
<p>Work <code>e</code> on a piece of rail brings its friction nearer to <code>min(2*mu, clean)</code> by the
fraction <code>e/needed</code> of what is left; rail that is dry stays as it is.</p>
<h4>Limitations</h4>
<p>The way to the next axle is a lag of first order over its length: right on average, but the edge of
a patch is blurred.</p>
</html>"));
end Rail;
