package HeatedHouse "An office of light wood whose heaters are switched at random"
  import Common = Effects;
  annotation (
    version="1.0",
    uses(Effects(version="1.0")),
    Documentation(info="<html>
<p>FlexHouse, an office of light wood at Risoe in Denmark, empty for six days of February while electric heaters
were switched at random: P. Bacher, H. Madsen, <em>Identifying suitable models for the heat dynamics of
buildings</em>, Energy and Buildings 43 (2011), 1511-1522.</p>
<h4>Published causes</h4>
<p>They let a model grow by one store of heat at a time, as the likelihood of one-step predictions asked:
of the heaters, of the walls, of the sensor; then sun on the walls. Neither a further store nor a direct
way out was significant.</p>
</html>"));
end HeatedHouse;
