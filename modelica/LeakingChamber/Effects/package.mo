within LeakingChamber;
package Effects "Catalogue: what the nominal chamber leaves out"
  annotation (Documentation(info="<html>
<p>What matters: 20 mbar within two minutes at 7 bar. That is 0.2 % of the sensor's range of 10 bar, by
which it may rest off, and less than a kelvin of the room does to a tight chamber.</p>
</html>"));
end Effects;
