package AirSupply "A reservoir of compressed air, filled by a compressor that starts and stops"
  import Common = Effects;
  annotation (
    version="1.0",
    uses(Effects(version="1.0")),
    Documentation(info="<html>
<p>The air production unit of a metro train: brakes, doors and suspension hang on a reservoir, which a
compressor fills whenever its pressure has fallen to a lower limit, until it has risen to an upper one.
The machine of B. Veloso, R. P. Ribeiro, J. Gama, P. M. Pereira, <em>The MetroPT dataset for predictive
maintenance</em>, Scientific Data 9 (2022) 764.</p>
<h4>Equations</h4>
<p>All right-hand sides are smooth or wrapped in <code>noEvent</code>. The medium is air, an ideal gas; the
reservoir is as warm as its surroundings.</p>
</html>"));
end AirSupply;
