within Effects.Friction;
model Dry "Dry friction, after Coulomb"
  extends Interfaces.Friction;
  parameter Units.Force coulomb(min=0.0) = 0.0 "Friction while it slides";
  parameter Units.Velocity v0(min=1e-9) = 0.01 "Velocity below which the sign is smoothed";
equation
  f = coulomb*tanh(v/v0);
  annotation (Documentation(info="<html>
<p><code>f = coulomb*tanh(v/v0)</code>: does not depend on the velocity, but for its sign.</p>
<h4>Limits</h4>
<p>No stiction: below <code>v0</code> the body creeps.</p>
<h4>References</h4>
<p>H. Olsson et al. (1998), European Journal of Control 4(3), 176-195.</p>
</html>"));
end Dry;
