within SealFriction.Effects;
model PressureFriction "dry friction of the seal that grows with the pressure"
  extends Common.Friction.LoadDependent(v0=5e-4, mu(unit="m2", max=1e-3));
  annotation (
    __Workbench(effect(
      size="mu", matters=3e-7,
      separation="strokes at pressures from zero to the highest")),
    Documentation(info="<html>
<p>The pressure behind a lip or a ring presses it to the wall, over a band of some width: <code>mu</code>
is the coefficient of friction times the area of that band. 1e-6 m2 are 0.1 N per bar.</p>
<h4>References</h4>
<p>H. K. Mueller, B. S. Nau (1998), <em>Fluid Sealing Technology</em>, Marcel Dekker.</p>
</html>"));
end PressureFriction;
