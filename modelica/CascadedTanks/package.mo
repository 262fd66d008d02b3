package CascadedTanks "Two tanks, one above the other, that a pump fills and that may overflow"
  import Common = Effects;
  annotation (
    version="1.0",
    uses(Effects(version="1.0")),
    Documentation(info="<html>
<p>A pump fills an upper tank, which empties into a lower one, which empties into the reservoir of the
pump. The machine of M. Schoukens, P. Mattsson, T. Wigren, J.-P. Noel, <em>Cascaded tanks benchmark
combining soft and hard nonlinearities</em> (2016): both tanks overflow where the inflow is large.</p>
<h4>Levels</h4>
<p>Levels are in volts, as the sensor of the lower tank reads them. That of the upper tank is in volts of
the lower one: a volt that leaves the upper tank is a volt in the lower one, whatever their sections.
Where only the lower level is measured any other scale of the upper one would do as well.</p>
<h4>Equations</h4>
<p>All right-hand sides are smooth or wrapped in <code>noEvent</code>.</p>
</html>"));
end CascadedTanks;
