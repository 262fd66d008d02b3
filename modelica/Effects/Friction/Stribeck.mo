within Effects.Friction;
model Stribeck "More friction close to standstill"
  extends Interfaces.Friction;
  parameter Units.Force excess(min=0.0) = 0.0 "Breakaway above sliding friction";
  parameter Units.Velocity vS(min=1e-9) = 0.1 "Velocity at which 1/e of the excess is left";
  parameter Units.Velocity v0(min=1e-9) = 0.01 "Velocity below which the sign is smoothed";
equation
  f = excess*exp(-(v/vS)^2)*tanh(v/v0);
  annotation (Documentation(info="<html>
<p><code>f = excess*exp(-(v/vS)^2)*tanh(v/v0)</code>: the peak alone, which adds to dry friction; a
film of lubricant forms as the velocity rises. <code>vS</code> should be several times
<code>v0</code>, which else hides the peak.</p>
<h4>References</h4>
<p>R. Stribeck (1902), Zeitschrift des VDI 46; the exponent 2 after A. Tustin (1947) and
B. Armstrong-Helouvry et al. (1994), Automatica 30(7), 1083-1138.</p>
</html>"));
end Stribeck;
