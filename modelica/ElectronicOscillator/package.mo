package ElectronicOscillator "A circuit that swings as a mass on a spring does"
  import Common = Effects;
  annotation (
    version="1.0",
    uses(Effects(version="1.0")),
    Documentation(info="<html>
<p>A second-order circuit with feedback: the <em>Silverbox</em> of T. Wigren, J. Schoukens, <em>Three free data
sets for development and benchmarking in nonlinear system identification</em>, European Control
Conference (2013). It stands for a mass on a spring that stiffens.</p>
<h4>Units</h4>
<p>Force and displacement are voltages, so that a stiffness is a number.</p>
</html>"));
end ElectronicOscillator;
