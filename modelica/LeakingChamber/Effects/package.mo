within LeakingChamber;
package Effects "Catalogue: what the nominal chamber leaves out"
  annotation (Documentation(info="<html>
<p>What matters: 50 mbar within two minutes at 7 bar. That is half a per cent of the sensor's range of
10 bar, and what two kelvin of the room do to a tight chamber.</p>
</html>"));
end Effects;
