within WheelsetRig.Contact;
function kalkerStiffness "Creep force per creepage at zero slip, G*a*b*c11, of one wheel"
  input Units.Force Q "Wheel load";
  input Units.Force K0 = 9.68e6 "Stiffness at the reference load";
  input Units.Force Q0 = 80000.0 "Reference load";
  output Units.Force K "Force per unit of creepage";
algorithm
  K := K0*(Q/Q0)^(2.0/3.0);
  annotation (Documentation(info="<html>
<p>The semi-axes a and b of the contact ellipse grow with the cube root of the load at constant
a/b, so their product and <code>K</code> grow with its power 2/3 (Hertz). The default is Kalker's
linear theory for wheel radius 0.46 m, roller radius 0.70 m, roller head 0.3 m, steel with
G = 80.5 GPa and Poisson's ratio 0.28: a = 5.23 mm, b = 5.51 mm, c11 = 4.17.</p>
<h4>References</h4>
<p>J. J. Kalker (1990), <em>Three-Dimensional Elastic Bodies in Rolling Contact</em>, Kluwer.</p>
</html>"));
end kalkerStiffness;
