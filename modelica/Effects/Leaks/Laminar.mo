within Effects.Leaks;
model Laminar "A laminar leak of a medium of constant density"
  extends Interfaces.Flow;
  parameter Real conductance(unit="kg/(s.Pa)", min=0.0) = 0.0 "Flow per difference of pressure";
equation
  q = conductance*(p1 - p2);
  annotation (Documentation(info="<html>
<p><code>q = conductance*(p1 - p2)</code>: a narrow gap or pores, after Hagen and Poiseuille, and
Darcy. A round channel of diameter d and length L has <code>pi*rho*d^4/(128*eta*L)</code>.</p>
<h4>References</h4>
<p>F. M. White, <em>Fluid Mechanics</em>, section 6.4.</p>
</html>"));
end Laminar;
