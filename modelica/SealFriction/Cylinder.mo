within SealFriction;
model Cylinder "Force by pressure and area, without a motion of its own"
  parameter Real A(unit="m2", min=1e-5) = 3.1415926535897932/4.0*0.025^2 "Area, by a bore of 25 mm";
  parameter Real friction(unit="N", min=0.0) = 0.0 "Friction of the seal while it slides";
  parameter Real v0(unit="m/s", min=1e-6) = 5e-4 "Velocity below which the sign is smoothed";

  input Real p(unit="Pa") "Pressure above that of the room";
  input Real s(unit="m") "Stroke";
  input Real v(unit="m/s") "Rate of the stroke";
  input Real dfriction(unit="N") "Correction of friction";

  output Real F(unit="N") = A*gauge.y + (friction + dfriction)*tanh(v/v0) + seal.f + spring.f
    "Force on the piston";
  output Real FReading(unit="N") = loadCell.y "Reading of the load cell";

  replaceable Common.Friction.Frictionless seal(v=v, load=p)
    constrainedby Common.Interfaces.Friction(v=v, load=p) "Seal";
  replaceable Interfaces.NoSpring spring(s=s)
    constrainedby Interfaces.PartialSpring(s=s) "What resists by the stroke";
  replaceable Common.Signals.Unchanged gauge(u=p)
    constrainedby Common.Interfaces.Signal(u=p) "Pressure sensor: the pressure that acts";
  replaceable Common.Signals.Unchanged loadCell(u=F)
    constrainedby Common.Interfaces.Signal(u=F) "Load cell";
  annotation (
    experiment(StopTime=10.0, Tolerance=1e-6),
    Documentation(info="<html>
<p><code>F = A*p</code>, and the friction of the seal, which is 0: what an estimator finds for it is
all that resists the motion. There are no states: the mass of the piston is of no account at some
mm/s.</p>
<h4>Area</h4>
<p>25 mm of bore are 49.1 N per bar. What is seen of it holds the gains of both sensors too; so it is
a level, which is calibrated within some per cent.</p>
<h4>Slots</h4>
<p>The seal sees rate and pressure; what several effects in it resist adds up, as with the spring,
which sees the stroke. The sensors change a reading each.</p>
</html>"));
end Cylinder;
