within WheelsetRig.Effects;
model SingleDiscWaterFilm "Water on one of three discs"
  extends Brakes.PartialPadFriction;
  parameter Real depth(unit="1", min=0.0, max=0.7) = 0.0
    "Share of the disc's friction lost at full film";
  parameter Units.Energy E0(min=0.05e6, max=2e6) = 0.45e6
    "Friction energy that leaves 1/e of the film";
  parameter Real nDiscs(unit="1", min=1.0) = 3.0 "Discs on the axle";
  Units.Energy E(start=0.0, fixed=true, nominal=1e6) "Friction energy of the wet disc";
protected
  Real loss(unit="1") "Share of its friction that the disc lacks";
equation
  loss = depth*exp(-E/E0);
  mu = level*(1.0 - loss/nDiscs);
  der(E) = level*(1.0 - loss)*Fperp*abs(v);
  annotation (Documentation(info="<html>
<p>As <code>WaterFilm</code>, on one disc: <code>mu</code> is the mean of the discs, <code>level*(1
- depth/nDiscs*exp(-E/E0))</code>, and <code>E</code> the energy of the wet disc, whose own friction
is lower than the mean.</p>
<h4>Limits</h4>
<p>Three slightly wet discs look the same (cosine of the two shapes 0.9996).</p>
</html>"));
end SingleDiscWaterFilm;
