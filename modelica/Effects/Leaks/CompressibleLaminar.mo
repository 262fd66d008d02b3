within Effects.Leaks;
model CompressibleLaminar "A laminar leak of a gas, whose density follows the pressure"
  extends Interfaces.Flow;
  parameter Real conductance(unit="kg/(s.Pa)", min=0.0) = 0.0
    "Flow per difference of pressure, at a mean pressure of pRef";
  parameter Units.Pressure pRef(min=1.0) = 1e5 "Mean pressure to which the conductance refers";
equation
  q = conductance*(p1^2 - p2^2)/(2.0*pRef);
  annotation (Documentation(info="<html>
<p><code>q = conductance*(p1 - p2)*(p1 + p2)/(2*pRef)</code>: isothermal flow of an ideal gas through
a narrow gap, whose density is that of the mean pressure. At a mean pressure of <code>pRef</code> it
is the law <code>Laminar</code>.</p>
<h4>References</h4>
<p>K. Jousten (ed.), <em>Handbook of Vacuum Technology</em>, Wiley: laminar flow of a gas through a
tube, after Hagen and Poiseuille.</p>
</html>"));
end CompressibleLaminar;
