within WheelsetRig.Effects;
model SingleDiscWaterFilm "Water on one disc, until its friction has dried it"
  extends WaterFilm(wet=1.0/3.0);
  annotation (
    __Workbench(effect(
      size="film", matters=0.05,
      shapes(E0={0.1e6, 0.3e6, 0.45e6, 1e6}),
      unless(condition="discs", is="wet",
        because="the conditions of the stops say which discs are wet"),
      separation="venting the brake units one by one")),
    Documentation(info="<html>
<p><code>WaterFilm</code> on one disc, which lacks friction, and so dries more slowly.</p>
<h4>Limits</h4>
<p>Three slightly wet discs look nearly the same (cosine of the two shapes 0.9996).</p>
</html>"));
end SingleDiscWaterFilm;
