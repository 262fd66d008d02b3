within WheelsetRig.Effects;
model SingleDiscWaterFilm "Water on one of three discs"
  extends WaterFilm(wet=1.0/3.0);
  annotation (Documentation(info="<html>
<p><code>WaterFilm</code> on one disc, which lacks friction, and so dries more slowly.</p>
<h4>Limits</h4>
<p>Three slightly wet discs look nearly the same (cosine of the two shapes 0.9996).</p>
</html>"));
end SingleDiscWaterFilm;
