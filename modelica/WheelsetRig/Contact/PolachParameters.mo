within WheelsetRig.Contact;
record PolachParameters "Parameters of Polach's creep force law; the defaults are the dry contact"
  Real kA(unit="1", min=0) = 1.0 "Reduction of the stiffness in the area of adhesion";
  Real kS(unit="1", min=0) = 0.4 "Reduction of the stiffness in the area of slip, kS <= kA";
  Real A(unit="1", min=0, max=1) = 0.4 "Friction at infinite slip velocity over friction at zero";
  Real B(unit="s/m", min=0) = 0.6 "Decay of the friction with slip velocity";
  annotation (Documentation(info="<html>
<table border=\"1\">
<tr><th>contact</th><th>kA</th><th>kS</th><th>A</th><th>B [s/m]</th><th>friction at zero slip</th></tr>
<tr><td>dry</td><td>1.0</td><td>0.4</td><td>0.4</td><td>0.6</td><td>0.40 .. 0.55</td></tr>
<tr><td>wet</td><td>0.3</td><td>0.1</td><td>0.4</td><td>0.2</td><td>0.25 .. 0.30</td></tr>
</table>
<h4>References</h4>
<p>O. Polach (2005), <em>Creep forces in simulations of traction vehicles running on adhesion
limit</em>, Wear 258, 992-1000.</p>
</html>"));
end PolachParameters;
